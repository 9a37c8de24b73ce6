// The isosurface of one slab as it leaves extraction and enters clustering: index arrays and the corners they hang on.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

namespace lamina {

/// An index into this slab's table, or (top bit set) into the next slab's: a slab's cells reach the next one's first
/// plane.
struct SlabIndex {
  static constexpr std::uint32_t kNextSlab = 0x80000000u;
  std::uint32_t bits = 0;
  [[nodiscard]] bool next() const { return (bits & kNextSlab) != 0; }
  [[nodiscard]] std::uint32_t index() const { return bits & ~kNextSlab; }
  bool operator==(const SlabIndex&) const = default;
  auto operator<=>(const SlabIndex&) const = default;
};

/// A lattice corner at an end of a minimal edge with a sign change (Cuccuru et al. 2009, section 3.5: the cluster's
/// seat). Lengths are in fixed-point steps of the frame (`Frame::step`), offsets relative to the corner.
struct SurfaceCorner {
  std::array<std::int32_t, 3> position{};  ///< fixed-point position (x, y, z; z is the sweep axis)
  std::array<float, 3> offset{};           ///< projected point minus corner, in steps
  std::array<float, 3> normal{};           ///< unit normal
  float distance = 0;                      ///< signed distance of the corner, in steps
  float curvature = 0;                     ///< signed mean curvature of the fit, 1/steps; 0 for the plane fit
  float cell = 0;                          ///< edge length of the finest incident cell, in steps
  /// The projected point is that of the corner's own samples, and not extended from neighbours, or uncertain. A corner
  /// without any value has a zero normal.
  bool trusted = false;
  bool crease = false;   ///< the projected point lies on a sharp edge, and the normal is the mean of the sides'
  bool leaning = false;  ///< while edges are numbered: its overhang has not been averaged yet
};

/// What few runs ask of such a corner: those whose values have the rare channels.
struct RareCorner {
  float density = 0;  ///< samples along the surface around, 1/steps^2; 0 where none are seen
  /// How far the surface reaches beyond its samples here, support radii (mls/overhang.h). Of a corner that no isovertex
  /// is nearest to it is not averaged over its neighbours, unless CornerRule asks for that.
  float overhang = 0;
};

/// An isovertex: a minimal edge whose ends have different signs. Owned by the slab that holds the edge's lower end.
/// Only valid ones are listed: both ends have a value, at least one is supported by the samples around it. A loop that
/// cannot be triangulated by chords gets a centre vertex: its two corners are any two of the loop's, chosen so that the
/// point at `t` between them comes close to the loop's mean.
struct IsoVertex {
  static constexpr std::uint8_t kCentre = 3;  ///< `axis` of a centre vertex
  SlabIndex low, high;  ///< SurfaceCorner at the lower and upper end; the lower is in this slab but for centre vertices
  float t = 0.5F;       ///< position along the edge from low to high, in (0, 1)
  std::uint8_t axis = 0;   ///< of the edge, or kCentre
  std::uint8_t level = 0;  ///< of the edge; of the cell for a centre vertex
  bool near_high = false;  ///< belongs to the cluster of the upper end (t > 0.5)
  /// Quadrants around the edge without surface, 4 bits: with u, v the axes after `axis` in cyclic order, bit 0 is the
  /// side (u-, v-), 1 (u+, v-), 2 (u+, v+), 3 (u-, v+). 0: an inner vertex of the mesh. Complete once the vertex's slab
  /// is triangulated.
  std::uint8_t open = 0;
};

using IsoTriangle = std::array<SlabIndex, 3>;  ///< counter-clockwise seen from outside

struct IsoSlab {
  std::int64_t slab = 0;
  std::vector<SurfaceCorner> corners;                 ///< in canonical order (level, tile, layer)
  std::vector<RareCorner> rare;                       ///< parallel to corners, or empty
  std::vector<std::vector<float>> corner_attributes;  ///< one array per attribute, parallel to corners
  /// In canonical order; behind the edges' come centre vertices (by cell), then copies that separate fans.
  std::vector<IsoVertex> vertices;
  std::vector<IsoTriangle> triangles;  ///< of the slab's cells, in canonical order
};

}  // namespace lamina

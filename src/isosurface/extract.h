// Isosurface extraction from the window, slab by slab: crack-free on the unconstrained octree (Cuccuru et al. 2009,
// section 3.5; docs/method.md "Extraction across levels"): isovertices and the corners at their edges' ends, triangles,
// and vertices of their own for separate fans.
#pragma once
#include <cstdint>

#include "isosurface/iso_mesh.h"
#include "octree/window.h"

namespace lamina {

/// Isovertices keep this distance from either end of their edge (parts of it), so that they stay distinct points.
inline constexpr float kEdgeMargin = 0.01F;

/// The projected point of a doubtful corner stays this near to the average of its own samples (cells).
inline constexpr float kFarthestFromSamples = 0.3F;

/// Where the projected points of doubtful corners lie.
enum class DoubtfulPoints : std::uint8_t {
  near_samples,  ///< no farther from the average of their own samples than kFarthestFromSamples
  as_extended,   ///< where the planes of their neighbours lead: for rims that are cut where the samples end
};

/// What is wanted of the corners at the surface.
struct CornerRule {
  DoubtfulPoints doubtful = DoubtfulPoints::near_samples;
  float trim = 0;              ///< overhang at which rims are going to be cut, support radii; 0: nobody asks for it
  bool all_overhangs = false;  ///< of all corners, also of those that no isovertex is nearest to
};

/// Calls for consecutive slabs go: number_edges(0), number_edges(1), triangulate(0), separate_fans(0), number_edges(2),
/// triangulate(1), separate_fans(1), ...; one empty slab beyond the last is numbered too. Slab s - 1 may leave the
/// window after triangulate(s), and its IsoSlab the hands of the caller after separate_fans(s). Results are the same
/// for any number of threads; the surface is the same for any height of slabs.
///
/// Finds the minimal edges with a sign change whose lower end lies in the slab, numbers those that are valid (both ends
/// are defined, at least one is supported by samples around it) and the corners at their ends, and fills out.corners,
/// out.corner_attributes and out.vertices (what `out` held before is gone, its storage used again). The octree up to
/// this slab, the signs of its corners and of the next one's first plane, and the values of its corners must be final.
/// `previous` (null before the first slab) is the slab below: its vertical edges that end in this slab are completed
/// now (`high`, `t`). Order of vertices: level, tile (z, y, x), layer, axis, place in the layer; of corners: level,
/// tile, layer, place. A corner that several levels hold is listed once, with the finest.
void number_edges(Window& window, std::int32_t slab, const CornerRule& rule, IsoSlab* previous, IsoSlab& out);

struct ExtractCounts {
  std::uint64_t crossing_cells = 0;      ///< leaf cells the surface passes through
  std::uint64_t general_cells = 0;       ///< of these, beside a subdivided one
  std::uint64_t rejected_loops = 0;      ///< loops with an invalid isovertex, in cells with valid ones: at a boundary
  std::uint64_t separated_vertices = 0;  ///< isovertices doubled so that each is a single fan
};

/// Triangles of the slab's leaf cells into out.triangles, in order of level, tile, cell, loop; the slab and the next
/// one must be numbered, the octree be final up to the next slab. Appends centre vertices to out.vertices; both slabs'
/// IsoVertex::open are brought up to date.
void triangulate(const Window& window, std::int32_t slab, IsoSlab& out, IsoSlab& next, ExtractCounts& counts);

/// After triangulate(slab): where rejected loops leave a vertex with two fans, gives the second a vertex of its own,
/// appended to slab.vertices, a few thousandths of the edge away. Triangles of the slab and of the one below (null
/// before the first) are re-indexed; those below are final then. `above`: numbered; null at the end.
void separate_fans(IsoSlab* below, IsoSlab& slab, const IsoSlab* above, ExtractCounts& counts);

}  // namespace lamina

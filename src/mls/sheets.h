// The surface of two or three sheets that meet in a sharp edge or a corner, seen from a point near them.
//
// Each sheet is a sphere or a plane of its own (its fit); the surface is where one of them ends at another: the greater
// of their distances counts where the edge is convex, the lesser where it is concave, as with the sharp features of
// Ohtake et al. 2003 (Multi-level partition of unity implicits, section 3.2). Also which corner's vertex takes on a
// crease.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "meshes/vec3.h"
#include "octree/window.h"

namespace lamina {

/// Sheets whose mean normals have a greater cosine (20 degrees) bend, but meet in no edge.
inline constexpr double kLeastBend = 0.94;
/// An edge belongs to the vertex of the corner whose cube it passes: no farther from it than half a cell along each
/// axis. Where that corner has no vertex a neighbour takes it on (takes_crease()), which is no farther than this.
inline constexpr double kCreaseReach = 1.0;
inline constexpr double kOwnCube = 0.5;

/// Lengths in cells, places relative to the corner.
struct Sheet {
  meshes::Vec3 point{};   ///< of the sheet, the nearest to the corner
  meshes::Vec3 normal{};  ///< there, of length one
  double curvature = 0;   ///< of the sphere; 0: a plane
  meshes::Vec3 mean{};    ///< of the samples
  double share = 0;       ///< of the samples' weight; all sheets' are 1

  /// Signed distance of a place.
  [[nodiscard]] double at(const meshes::Vec3& x) const;
  /// Of length one.
  [[nodiscard]] meshes::Vec3 normal_at(const meshes::Vec3& x) const;
};

/// What several sheets are at the corner.
struct SheetsValue {
  double distance = 0;      ///< signed
  meshes::Vec3 normal{};    ///< at the surface point that is nearest to the corner
  double curvature = 0;     ///< there; 0 on an edge
  std::size_t nearest = 0;  ///< the sheet with that point, or the one with most samples around its edge
  meshes::Vec3 lean{};      ///< from that point to the mean of the samples, unfolded into one plane
  bool creased = false;     ///< an edge or a corner passes near the corner:
  meshes::Vec3 crease{};    ///< there, in the corner's own cube if anywhere
  meshes::Vec3 crease_normal{};
};

/// One to three sheets. False when they do not make a surface: where samples of one lie on either side of the other.
bool combine_sheets(const std::array<Sheet, 3>& sheets, std::size_t count, SheetsValue& out);

/// The point of a crease near a corner as a record of corner values holds it, in two floats: place to 2^-13 cells,
/// normal to a thousandth.
std::array<float, 2> packed_crease(const meshes::Vec3& place, const meshes::Vec3& normal);
/// False where there is none.
bool unpacked_crease(const float* packed, meshes::Vec3& place, meshes::Vec3& normal);

// Which corner's vertex takes on a crease.
//
// A corner has a vertex when the surface crosses one of its edges in the half that is its own. A sharp edge may pass
// through a corner's cube and cross none of these; then the nearest corner around that has a vertex takes it there, and
// the triangles beside it lie on the sheets.

/// Whether the vertex of a corner goes to the crease that its record knows of, at `record`'s channels. A function of
/// the trusted corners within three cells, in the slab, the one below and the one above, which must be projected; a
/// corner whose question leads out of these stays where it is.
bool takes_crease(const Window& window, int level, const Cell& corner, std::int32_t slab, const float* record);

}  // namespace lamina

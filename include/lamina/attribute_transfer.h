// Attributes from points to the vertices of a mesh.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "lamina/mesh.h"
#include "lamina/points.h"
#include "lamina/run.h"

namespace lamina {

/// What a vertex gets.
enum class TransferMode {
  nearest,   ///< the value of the nearest point
  weighted,  ///< the mean of the points nearer than R, with weights (1 - d^2 / R^2)^4: for colours, not for classes
};

struct TransferSettings {
  TransferMode mode = TransferMode::nearest;
  std::vector<std::string> attributes;  ///< names; empty: all that the points have
  /// Mesh units, >= 0. nearest: points farther than this count for nothing, 0: no limit. weighted: R of every point, 0:
  /// twice the point's own radius.
  double distance = 0;
  std::uint64_t points_at_once = 4'000'000;  ///< > 0, held in memory at a time: about 50 bytes each, and the attributes
};

struct TransferReport {
  std::uint64_t points = 0;       ///< with finite position and radius
  std::uint64_t unreachable = 0;  ///< vertices without a point near enough
};

/// Sets attributes of all vertices from the points near them. The points may be more than memory holds: they come in
/// portions, and every vertex searches each. Of equally near points the first counts. In `weighted` mode a vertex
/// without a point within R takes the value of the nearest one. A vertex that still has none keeps the mesh's value
/// where there is one, else gets 0. An attribute that the mesh has already takes the points' type. The result does not
/// depend on threads. Throws Error: usage (an attribute that is not there, naming those that are; weighted without
/// radii or distance), empty (no points), and what the source throws.
TransferReport transfer_attributes(PointSource& points, TriangleMesh& mesh, const TransferSettings& settings,
                                   const RunContext& run = {});

}  // namespace lamina

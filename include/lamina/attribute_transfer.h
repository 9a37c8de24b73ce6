// Attributes from points to the vertices of a mesh.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "lamina/mesh.h"
#include "lamina/points.h"
#include "lamina/run.h"

namespace lamina {

enum class TransferMode {
  nearest,   ///< the value of the nearest point
  weighted,  ///< the mean of the points in reach, weights (1 - d^2 / R^2)^4: colours; not names or classes
};

struct TransferSettings {
  TransferMode mode = TransferMode::nearest;
  std::vector<std::string> attributes;  ///< names; empty: all the points have
  /// Mesh units. nearest: points farther than this give nothing, 0: no limit. weighted: R of every point, 0: twice the
  /// points' own radii.
  double distance = 0;
  std::uint64_t points_at_once = 4'000'000;  ///< held in memory, > 0: about 50 bytes each and their attributes
};

struct TransferReport {
  std::uint64_t points = 0;       ///< usable ones
  std::uint64_t unreachable = 0;  ///< vertices that no point reached
};

/// Sets the attributes at all vertices. Points may be more than memory holds: they come in portions, each in a tree,
/// and every vertex looks into each. A vertex that no point reaches keeps the mesh's value where there is one, else
/// gets 0; in `weighted` mode it first takes the nearest point's. Of equally near points the first counts. Attributes
/// the mesh has already are replaced, with the points' type.
/// Throws Error: usage (an attribute that is not there, naming those that are; weighted without radii or distance),
/// empty (no points), and what the source throws.
TransferReport transfer_attributes(PointSource& points, TriangleMesh& mesh, const TransferSettings& settings,
                                   const RunContext& run = {});

}  // namespace lamina

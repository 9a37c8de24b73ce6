// Fewer triangles for the same surface: quadric edge contraction.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "lamina/mesh.h"
#include "lamina/run.h"

namespace lamina {

/// One of these.
struct SimplifySettings {
  std::uint64_t triangles = 0;  ///< how many are wanted, >= 1
  double error = 0;             ///< how far it may get from what it was, > 0, in mesh units
  double ratio = 0;             ///< of the triangles that stay, > 0 and up to 1
  /// > 0 and at most 1: triangles go where the surface is flat, that is, where the root mean square distance of the new
  /// vertex from the planes of those it stands for is no more than so many lengths of an edge there. Boundaries stay as
  /// they are, and no attribute changes by more than a quarter of its standard deviation.
  double deviation = 0;
  [[nodiscard]] bool wanted() const { return triangles > 0 || error != 0 || ratio != 0 || deviation != 0; }
};

struct SimplifyStats {
  std::uint64_t triangles_before = 0, triangles_after = 0;
  std::uint64_t vertices_after = 0;
  std::uint64_t contractions = 0;
  bool reached = false;  ///< no more triangles than wanted; else no contraction was left that keeps shape and topology.
                         ///< With `error` and `deviation`: true
  double deviation = 0;  ///< largest root mean square distance of a new vertex from the planes it stands for
};

/// Contracts edges in order of their quadric error (Garland and Heckbert 1997), each to the point of least error, found
/// without a singular value decomposition because every plane counts as a little noisy (Trettner and Kobbelt 2020).
/// Planes through boundary edges hold boundaries in place. The mesh stays manifold, its parts, handles and boundary
/// loops stay as many (the link condition of Dey, Edelsbrunner, Guha and Nekhayev 1999), and no triangle turns by more
/// than 78 degrees at a step. Attributes and normals are interpolated along the contracted edges. Vertices and
/// triangles keep their order, and positions stay floats where all of them are; vertices in no triangle are dropped.
/// Works on pieces that fit the processor's cache, side by side, and cuts the mesh elsewhere round by round; the last
/// edges go in one order. A mesh of more than a million triangles is cut into regions of no more, which wait in
/// temporary files (docs/simplify.md). Some 300 bytes of work space a triangle, of a million at the most; the same mesh
/// gives the same bytes, for any number of threads. Throws Error(usage) for settings out of range, or more triangles
/// than there are, Error(unreadable) for a mesh that is not manifold or has no triangles, Error(internal) when
/// cancelled; the mesh is then not changed or of no use.
SimplifyStats simplify_mesh(TriangleMesh& mesh, const SimplifySettings& settings, const RunContext& run = {});

/// The same of a mesh file that need not fit in memory, into files that need not either, at least one (their endings
/// say the format): a binary PLY of triangles, as this program writes them, with normals. Nothing for any other file,
/// which is to be read whole. Throws as above, Error(unreadable) for a damaged file, Error(budget) for a full disk.
std::optional<SimplifyStats> simplify_file(const std::string& path, const std::vector<std::string>& outputs,
                                           const SimplifySettings& settings, const RunContext& run = {});

}  // namespace lamina

// Fewer triangles for the same surface: quadric edge contraction.
#pragma once
#include <cstdint>

#include "lamina/mesh.h"
#include "lamina/run.h"

namespace lamina {

struct SimplifySettings {
  std::uint64_t triangles = 0;  ///< how many are wanted, >= 1; without `error`
  double error = 0;             ///< how far it may get from what it was, > 0, in mesh units; without `triangles`
};

struct SimplifyStats {
  std::uint64_t triangles_before = 0, triangles_after = 0;
  std::uint64_t contractions = 0;
  bool reached = false;  ///< no more triangles than wanted; else no contraction was left that keeps shape and topology.
                         ///< With `error`: true
};

/// Contracts edges in order of their quadric error (Garland and Heckbert 1997), each to the point of least error, found
/// without a singular value decomposition because every plane counts as a little noisy (Trettner and Kobbelt 2020).
/// Planes through boundary edges hold boundaries in place. The mesh stays manifold, its parts, handles and boundary
/// loops stay as many (the link condition of Dey, Edelsbrunner, Guha and Nekhayev 1999), and no triangle turns by more
/// than 78 degrees at a step. Attributes and normals are interpolated along the contracted edges. Vertices and
/// triangles keep their order, and positions stay floats where all of them are; vertices in no triangle are dropped.
/// Works on pieces that fit the processor's cache, side by side, and cuts the mesh elsewhere round by round; the last
/// edges go in one order. Some 300 bytes of work space a triangle; the same mesh gives the same bytes, for any number
/// of threads. The error is not bounded. Throws Error(usage) for a number of triangles that is 0 or larger than the
/// mesh's, Error(unreadable) for a mesh that is not manifold or has no triangles, Error(internal) when cancelled; the
/// mesh is then not changed or of no use.
SimplifyStats simplify_mesh(TriangleMesh& mesh, const SimplifySettings& settings, const RunContext& run = {});

}  // namespace lamina

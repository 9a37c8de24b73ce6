// Vertex normals that the triangles around confirm.
//
// The normals of a fit are means of the samples' own. Where these are noisy, or those of several sides of something
// thin, the surface says better how it lies: its triangles follow where the samples are.
#pragma once
#include <cstdint>
#include <deque>
#include <vector>

#include "meshes/mesh_slab.h"
#include "meshes/vec3.h"

namespace lamina {

/// Slabs below and above one on which its normals depend.
inline constexpr int kSettleReach = 1;

/// Takes a streamed mesh slab by slab and gives it back, kSettleReach slabs later, its normals settled between the
/// fit's and the triangles' (meshes/settled_normal.h). Where one of the two says nothing the other stands.
class NormalSettler {
 public:
  void push(MeshSlab slab);
  void finish();  ///< no more slabs come
  /// The next slab, false when none is ready.
  bool pop(MeshSlab& out);

 private:
  struct Held {
    MeshSlab mesh;
    std::uint32_t first = 0;              ///< number of its first vertex
    std::vector<meshes::Vec3> triangles;  ///< by vertex, the sum of the normals around, each as long as twice the area
  };

  void add_triangles_of_last();
  void settle(Held& slab);

  std::deque<Held> held_;  ///< the last, which may still get triangles, and the one below it while those are added
  std::deque<MeshSlab> ready_;
  std::uint32_t pushed_ = 0;  ///< vertices
};

}  // namespace lamina

// A triangulated grid as the slabs of a streamed mesh.
#pragma once
#include <cmath>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "boundary/rims.h"

namespace lamina::test {

using WantedSquare = std::function<bool(int, int)>;

/// Rows of a triangulated grid in the plane, a slab each: the triangles of a row hang on the row below. `overhang`: of
/// the vertex (i, row); `wanted`: which squares there are.
inline std::vector<MeshSlab> grid_slabs(
    int side, const std::function<float(int, int)>& overhang,
    const WantedSquare& wanted = [](int, int) { return true; }) {
  std::vector<MeshSlab> slabs;
  for (int row = 0; row < side; ++row) {
    MeshSlab& slab = slabs.emplace_back();
    slab.slab = row;
    for (int i = 0; i < side; ++i) {
      slab.vertices.x.push_back(i);
      slab.vertices.y.push_back(row);
      slab.vertices.z.push_back(0);
      slab.vertices.nx.push_back(0);
      slab.vertices.ny.push_back(0);
      slab.vertices.nz.push_back(1);
      slab.vertices.overhang.push_back(overhang(i, row));
    }
    if (row == 0) continue;
    const auto at = [side](int i, int j) { return static_cast<std::uint32_t>(j * side + i); };
    for (int i = 0; i + 1 < side; ++i) {
      if (!wanted(i, row - 1)) continue;
      slab.triangles.push_back({at(i, row - 1), at(i + 1, row - 1), at(i, row)});
      slab.triangles.push_back({at(i + 1, row - 1), at(i + 1, row), at(i, row)});
    }
  }
  return slabs;
}

inline constexpr int kSide = 40;

/// The squares of a grid that are wanted. No vertex reaches beyond its samples.
inline std::vector<MeshSlab> squares(const WantedSquare& wanted) {
  return grid_slabs(
      kSide, [](int, int) { return 0.0F; }, wanted);
}

inline bool in_disc(int i, int row) {
  return std::hypot(i + 0.5 - kSide / 2.0, row + 0.5 - kSide / 2.0) < 15;
}

/// What comes out of a pass over a streamed mesh.
template <typename Pass>
std::vector<MeshSlab> passed(Pass pass, std::vector<MeshSlab> slabs) {
  std::vector<MeshSlab> out;
  MeshSlab slab;
  const auto take = [&] {
    while (pass.pop(slab)) out.push_back(std::move(slab));
  };
  for (MeshSlab& s : slabs) {
    pass.push(std::move(s));
    take();
  }
  pass.finish();
  take();
  return out;
}

}  // namespace lamina::test

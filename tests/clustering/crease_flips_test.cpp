#include "clustering/crease_flips.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include "boundary/grid_slabs.h"
#include "clustering/topology_check.h"
#include "meshes/vec3.h"

namespace lamina {
namespace {

using meshes::Vec3;
using Triangle = std::array<std::uint32_t, 3>;

constexpr double kBend = 0.94;
constexpr int kRows = 12;  // of as many vertices, a slab each

std::vector<MeshSlab> flat_grid() {
  return test::grid_slabs(kRows, [](int, int) { return 0.0F; });
}

void set_normal(MeshSlab& slab, std::size_t i, const Vec3& n) {
  const auto length = static_cast<float>(meshes::norm(n));
  slab.vertices.nx[i] = static_cast<float>(n[0]) / length;
  slab.vertices.ny[i] = static_cast<float>(n[1]) / length;
  slab.vertices.nz[i] = static_cast<float>(n[2]) / length;
}

/// A grid bent along its main diagonal, down on both sides. The squares there are cut along the other one.
std::vector<MeshSlab> roof() {
  std::vector<MeshSlab> slabs = flat_grid();
  for (int row = 0; row < kRows; ++row) {
    MeshSlab& slab = slabs[static_cast<std::size_t>(row)];
    for (int i = 0; i < kRows; ++i) {
      const auto at = static_cast<std::size_t>(i);
      slab.vertices.z[at] = -std::abs(i - row);
      const int side = (i > row) - (i < row);
      set_normal(slab, at, {double(side), -double(side), 1});
    }
  }
  return slabs;
}

struct Whole {
  std::vector<Vec3> positions;
  std::vector<Triangle> triangles;

  explicit Whole(const std::vector<MeshSlab>& slabs) {
    for (const MeshSlab& s : slabs) {
      for (std::size_t i = 0; i < s.vertices.size(); ++i)
        positions.push_back({s.vertices.x[i], s.vertices.y[i], s.vertices.z[i]});
      triangles.insert(triangles.end(), s.triangles.begin(), s.triangles.end());
    }
  }
  [[nodiscard]] test::Topology topology() const { return test::topology_of(positions.size(), triangles); }
  /// Each from its least vertex on, ascending.
  [[nodiscard]] std::vector<Triangle> canonical() const {
    std::vector<Triangle> out = triangles;
    for (Triangle& t : out) std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    std::sort(out.begin(), out.end());
    return out;
  }
};

TEST(CreaseFlips, SidesFollowTheCrease) {
  const std::vector<MeshSlab> before = roof();
  const std::vector<MeshSlab> after = test::passed(CreaseFlips(kBend), before);
  ASSERT_EQ(after.size(), before.size());
  const Whole mesh(after);
  EXPECT_EQ(mesh.triangles.size(), Whole(before).triangles.size());
  EXPECT_EQ(mesh.positions, Whole(before).positions);
  EXPECT_TRUE(mesh.topology().manifold());
  EXPECT_TRUE(mesh.topology().same_surface(Whole(before).topology()));
  for (const Triangle& t : mesh.triangles) {
    const Vec3 n = meshes::unit(meshes::area_normal(mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]));
    EXPECT_NEAR(n[2], std::sqrt(1.0 / 3), 1e-9) << "each lies in one of the two sheets";
  }
}

TEST(CreaseFlips, WhatHasNoCreaseStaysAsItIs) {
  const std::vector<MeshSlab> before = flat_grid();
  const std::vector<MeshSlab> after = test::passed(CreaseFlips(kBend), before);
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t s = 0; s < after.size(); ++s) {
    EXPECT_EQ(after[s].slab, before[s].slab);
    EXPECT_EQ(after[s].triangles, before[s].triangles);
  }
}

/// A tetrahedron, whose two triangles at one side would become those at the opposite one.
TEST(CreaseFlips, NoEdgeIsMadeThatIsThere) {
  const std::array<Vec3, 4> at{Vec3{-1, 0, 0}, Vec3{1, 0, 0}, Vec3{0, 1, 1}, Vec3{0, -1, 1}};
  MeshSlab slab;
  slab.triangles = {{0, 1, 2}, {1, 0, 3}, {0, 2, 3}, {1, 3, 2}};
  for (const Vec3& p : at) {
    slab.vertices.x.push_back(p[0]);
    slab.vertices.y.push_back(p[1]);
    slab.vertices.z.push_back(p[2]);
  }
  for (auto* n : {&slab.vertices.nx, &slab.vertices.ny, &slab.vertices.nz}) n->resize(4);
  set_normal(slab, 0, meshes::area_normal(at[0], at[3], at[2]));
  set_normal(slab, 1, meshes::area_normal(at[3], at[1], at[2]));
  set_normal(slab, 2, {0, 0, 1});
  set_normal(slab, 3, {0, 0, 1});
  std::vector<MeshSlab> open{slab};
  open[0].triangles.resize(2);
  EXPECT_NE(Whole(test::passed(CreaseFlips(kBend), open)).triangles, open[0].triangles)
      << "without the others they would";
  EXPECT_EQ(Whole(test::passed(CreaseFlips(kBend), {slab})).triangles, slab.triangles);
}

RC_GTEST_PROP(CreaseFlips, AnyMeshStaysTheSurfaceItIs, ()) {
  std::mt19937 random(*rc::gen::arbitrary<std::uint32_t>());
  std::vector<MeshSlab> before = test::grid_slabs(
      kRows, [](int, int) { return 0.0F; }, [&](int, int) { return random() % 8 != 0; });
  std::uniform_real_distribution<> height(-1, 1);
  const std::array<Vec3, 3> sheets{Vec3{1, 0, 1}, Vec3{-1, 0.5, 1}, Vec3{0, -1, 1}};
  for (MeshSlab& slab : before) {
    for (std::size_t i = 0; i < slab.vertices.size(); ++i) {
      slab.vertices.z[i] = height(random);
      set_normal(slab, i, sheets[random() % 3]);
    }
  }
  std::vector<MeshSlab> shuffled = before;
  for (MeshSlab& slab : shuffled) std::shuffle(slab.triangles.begin(), slab.triangles.end(), random);
  const std::vector<MeshSlab> after = test::passed(CreaseFlips(kBend), before);
  const Whole mesh(after);
  const test::Topology was = Whole(before).topology();
  const test::Topology is = mesh.topology();
  RC_ASSERT(is.bad_edges == was.bad_edges && is.bad_vertices == was.bad_vertices && is.degenerate == 0U &&
            is.duplicates == 0U && is.same_surface(was));
  RC_ASSERT(mesh.canonical() == Whole(test::passed(CreaseFlips(kBend), shuffled)).canonical());
  for (std::size_t s = 0; s < after.size(); ++s) {
    for (const Triangle& t : after[s].triangles) {
      for (const std::uint32_t v : t) RC_ASSERT(v / kRows <= s && v / kRows + 1 >= s);
    }
  }
}

/// What a slab looks like does not depend on those farther away than kFlipReach.
RC_GTEST_PROP(CreaseFlips, FarSlabsDoNotCount, ()) {
  std::vector<MeshSlab> whole = roof();
  const auto from = *rc::gen::inRange<std::size_t>(0, 4);
  const auto end = *rc::gen::inRange<std::size_t>(kRows - 3, kRows);
  std::mt19937 random(*rc::gen::arbitrary<std::uint32_t>());
  std::uniform_real_distribution<> height(-0.3, 0.3);
  for (MeshSlab& slab : whole) {
    for (double& z : slab.vertices.z) z += height(random);
  }
  const std::vector<MeshSlab> all = test::passed(CreaseFlips(kBend), whole);
  // The first slab keeps its vertices, but its triangles are not known.
  std::vector<MeshSlab> part(whole.begin() + static_cast<std::ptrdiff_t>(from),
                             whole.begin() + static_cast<std::ptrdiff_t>(end));
  part[0].triangles.clear();
  for (MeshSlab& slab : part) {
    for (Triangle& t : slab.triangles) {
      for (std::uint32_t& v : t) v -= static_cast<std::uint32_t>(from) * kRows;
    }
  }
  std::vector<MeshSlab> some = test::passed(CreaseFlips(kBend), part);
  for (std::size_t s = kFlipReach + 1; s + kFlipReach < some.size(); ++s) {
    for (Triangle& t : some[s].triangles) {
      for (std::uint32_t& v : t) v += static_cast<std::uint32_t>(from) * kRows;
    }
    RC_ASSERT(some[s].triangles == all[from + s].triangles);
  }
}

}  // namespace
}  // namespace lamina

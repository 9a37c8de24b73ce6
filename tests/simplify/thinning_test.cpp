// Streamed meshes thinned out where they are flat.
#include "simplify/thinning.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <set>

#include "lamina/error.h"
#include "lamina/measure.h"
#include "lamina/mesh.h"
#include "lamina/simplify.h"
#include "meshes/mesh_blocks.h"
#include "meshes/mesh_files.h"

namespace lamina::simplify {
namespace {

using namespace testing_meshes;

constexpr std::uint32_t kSide = 120;

/// The unit square with a hole: flat in the lower half, a wave in the upper one; red by place.
template <class Red>
TriangleMesh half_flat(const Red& red) {
  TriangleMesh mesh;
  mesh.layout = {{"red", ScalarType::uint8}};
  mesh.attributes.resize(1);
  for (std::uint32_t i = 0; i <= kSide; ++i)
    for (std::uint32_t j = 0; j <= kSide; ++j) {
      const double x = static_cast<double>(i) / kSide, y = static_cast<double>(j) / kSide;
      mesh.positions.push_back({x, y, x < 0.5 ? 0.0 : 0.05 * (1 - std::cos(16 * (x - 0.5))) * std::cos(40 * y)});
      mesh.normals.push_back({0, 0, 1});
      mesh.attributes[0].push_back(red(i, j));
    }
  for (std::uint32_t i = 0; i < kSide; ++i)
    for (std::uint32_t j = 0; j < kSide; ++j) {
      if (i > 40 && i < 80 && j > 40 && j < 60) continue;
      const std::uint32_t a = i * (kSide + 1) + j, b = a + kSide + 1;
      mesh.triangles.push_back({a, b, b + 1});
      mesh.triangles.push_back({a, b + 1, a + 1});
    }
  return mesh;
}

TriangleMesh half_flat() {
  return half_flat([](std::uint32_t, std::uint32_t) { return 7.0F; });
}

TriangleMesh thinned(const TriangleMesh& mesh, double deviation, std::size_t block, SimplifyStats* stats = nullptr) {
  meshes::HeldMesh blocks(mesh);
  TriangleMesh all;
  all.layout = mesh.layout;
  all.attributes.resize(mesh.attributes.size());
  const auto add = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
  const auto take = [&](const TriangleMesh& piece) {
    add(all.positions, piece.positions);
    add(all.normals, piece.normals);
    for (std::size_t a = 0; a < all.attributes.size(); ++a) add(all.attributes[a], piece.attributes[a]);
    add(all.triangles, piece.triangles);
  };
  const SimplifyStats got = thin_blocks(blocks, deviation, take, {}, block);
  if (stats != nullptr) *stats = got;
  return all;
}

/// Triangles of the flat half, a row of the grid away from the wave.
std::size_t flat_triangles(const TriangleMesh& mesh) {
  return static_cast<std::size_t>(std::count_if(mesh.triangles.begin(), mesh.triangles.end(), [&](const auto& t) {
    return std::all_of(t.begin(), t.end(), [&](std::uint32_t v) { return mesh.positions[v][0] < 0.49; });
  }));
}

std::set<std::array<double, 3>> outer_vertices(const TriangleMesh& mesh) {
  std::set<std::array<double, 3>> found;
  for (const auto& at : mesh.positions) {
    if (at[0] == 0 || at[0] == 1 || at[1] == 0 || at[1] == 1) found.insert(at);
  }
  return found;
}

TEST(Thinning, TakesWhatIsFlatAndKeepsRimsAndRelief) {
  const TriangleMesh mesh = half_flat();
  const CheckReport was = check_mesh(mesh);
  for (const std::size_t block : {std::size_t{1500}, std::size_t{9000}, kThinBlock}) {
    SimplifyStats stats;
    const TriangleMesh fewer = thinned(mesh, 0.01, block, &stats);
    const CheckReport is = check_mesh(fewer);
    EXPECT_TRUE(is.manifold());
    EXPECT_EQ(is.components, was.components);
    EXPECT_EQ(is.euler_characteristic, was.euler_characteristic);
    EXPECT_EQ(is.boundary_loops, was.boundary_loops);
    EXPECT_EQ(is.boundary_edges, was.boundary_edges);
    EXPECT_EQ(is.unreferenced_vertices, 0U);
    EXPECT_EQ(outer_vertices(fewer), outer_vertices(mesh));
    EXPECT_EQ(stats.triangles_before, mesh.triangles.size());
    EXPECT_EQ(stats.triangles_after, fewer.triangles.size());
    EXPECT_EQ(stats.vertices_after, fewer.positions.size());
    // Rims are fine; between them a few triangles do.
    EXPECT_LT(flat_triangles(fewer), flat_triangles(mesh) / 6);
    EXPECT_GT(fewer.triangles.size() - flat_triangles(fewer), (mesh.triangles.size() - flat_triangles(mesh)) / 3);
    EXPECT_LT(compare(fewer, mesh, {100'000}).b_to_a->rms, 0.01 / kSide);
  }
}

TEST(Thinning, GoesFartherTheMoreItMay) {
  const TriangleMesh mesh = half_flat();
  std::size_t before = mesh.triangles.size();
  for (const double deviation : {0.002, 0.01, 0.05}) {
    const std::size_t left = thinned(mesh, deviation, kThinBlock).triangles.size();
    EXPECT_LT(left, before);
    before = left;
  }
}

TEST(Thinning, KeepsWhatAttributesShow) {
  // Squares of four by four in two colours: no vertex stands for two of them.
  const TriangleMesh mesh =
      half_flat([](std::uint32_t i, std::uint32_t j) { return (i / 4 + j / 4) % 2 == 0 ? 10.0F : 200.0F; });
  const TriangleMesh fewer = thinned(mesh, 0.05, kThinBlock);
  EXPECT_LT(fewer.triangles.size(), mesh.triangles.size());
  EXPECT_GT(flat_triangles(fewer), flat_triangles(thinned(half_flat(), 0.05, kThinBlock)) * 6 / 5);
  for (const float red : fewer.attributes[0]) EXPECT_TRUE(red == 10 || red == 200) << red;
}

TEST(Thinning, IsTheSameForAnyThreads) {
  TriangleMesh one = half_flat(), four = one;
  RunContext run;
  run.threads = 1;
  simplify_mesh(one, {.deviation = 0.02}, run);
  run.threads = 4;
  simplify_mesh(four, {.deviation = 0.02}, run);
  EXPECT_EQ(one.positions, four.positions);
  EXPECT_EQ(one.triangles, four.triangles);
}

TEST(Thinning, FillingsAtTheEndFindTheirRim) {
  // The same mesh with the triangles of a stretch moved to the end, as what closes a hole is.
  TriangleMesh mesh = half_flat();
  std::stable_partition(mesh.triangles.begin(), mesh.triangles.end(),
                        [](const auto& t) { return t[0] % (kSide + 1) > 20 || t[0] / (kSide + 1) > 10; });
  const TriangleMesh fewer = thinned(mesh, 0.01, 1500);
  const CheckReport is = check_mesh(fewer), was = check_mesh(mesh);
  EXPECT_TRUE(is.manifold());
  EXPECT_EQ(is.euler_characteristic, was.euler_characteristic);
  EXPECT_EQ(is.boundary_edges, was.boundary_edges);
}

TEST(Thinning, RefusesWhatIsNoMesh) {
  TriangleMesh mesh = half_flat();
  mesh.triangles.push_back({0, 1, static_cast<std::uint32_t>(mesh.positions.size())});
  expect_error(ExitCode::unreadable, [&] { thinned(mesh, 0.01, kThinBlock); }, {"vertex"});
  mesh.triangles.back() = {0, 1, 1};
  expect_error(ExitCode::unreadable, [&] { thinned(mesh, 0.01, kThinBlock); }, {"manifold"});
  for (const double deviation : {-0.1, 1.5}) {
    expect_error(ExitCode::usage, [&] { simplify_mesh(mesh, {.deviation = deviation}); }, {"deviation"});
  }
}

}  // namespace
}  // namespace lamina::simplify

// Meshes simplified region by region from and to the disk, against what is true of any simplification.
#include "simplify/streamed.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "lamina/error.h"
#include "lamina/measure.h"
#include "lamina/mesh.h"
#include "lamina/simplify.h"
#include "meshes/mesh_blocks.h"
#include "meshes/mesh_files.h"

namespace lamina::simplify {
namespace {

using namespace testing_meshes;

/// A wave over the unit square with a hole, coloured by place; more than a piece.
TriangleMesh coloured_wave(std::uint32_t n) {
  TriangleMesh mesh;
  mesh.layout = {{"red", ScalarType::uint8}};
  mesh.attributes.resize(1);
  for (std::uint32_t i = 0; i <= n; ++i)
    for (std::uint32_t j = 0; j <= n; ++j) {
      const double x = static_cast<double>(i) / n, y = static_cast<double>(j) / n;
      // Half of it flat, where most triangles can go.
      mesh.positions.push_back({x, y, x < 0.5 ? 0.0 : 0.05 * (1 - std::cos(8 * (x - 0.5))) * std::cos(20 * y)});
      mesh.normals.push_back({0, 0, 1});
      mesh.attributes[0].push_back(static_cast<float>(200 * y));
    }
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::uint32_t j = 0; j < n; ++j) {
      if (i > n / 3 && i < 2 * n / 3 && j > n / 3 && j < n / 2) continue;
      const std::uint32_t a = i * (n + 1) + j, b = a + n + 1;
      mesh.triangles.push_back({a, b, b + 1});
      mesh.triangles.push_back({a, b + 1, a + 1});
    }
  return mesh;
}

TriangleMesh in_regions(const TriangleMesh& mesh, const SimplifySettings& settings, std::uint64_t region, int threads,
                        SimplifyStats* stats = nullptr) {
  meshes::HeldMesh blocks(mesh);
  TriangleMesh all;
  all.layout = mesh.layout;
  all.attributes.resize(mesh.attributes.size());
  RunContext run;
  run.threads = threads;
  const auto add = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
  const auto take = [&](const TriangleMesh& piece) {
    add(all.positions, piece.positions);
    add(all.normals, piece.normals);
    add(all.attributes[0], piece.attributes[0]);
    add(all.triangles, piece.triangles);
  };
  const SimplifyStats got =
      simplify_blocks(blocks, settings, std::filesystem::temp_directory_path().string(), take, run, region);
  if (stats != nullptr) *stats = got;
  return all;
}

void expect_same_topology(const TriangleMesh& is, const TriangleMesh& was) {
  const CheckReport a = check_mesh(is), b = check_mesh(was);
  EXPECT_TRUE(a.manifold());
  EXPECT_EQ(a.components, b.components);
  EXPECT_EQ(a.euler_characteristic, b.euler_characteristic);
  EXPECT_EQ(a.boundary_loops, b.boundary_loops);
  EXPECT_EQ(a.unreferenced_vertices, 0U);
  EXPECT_EQ(a.duplicate_vertices, 0U);
}

TEST(StreamedSimplify, IsAsGoodAsInMemory) {
  const TriangleMesh mesh = coloured_wave(200);
  for (const std::uint64_t wanted : {std::uint64_t{40'000}, std::uint64_t{9'000}}) {
    TriangleMesh held = mesh;
    simplify_mesh(held, {.triangles = wanted});
    SimplifyStats stats;
    const TriangleMesh fewer = in_regions(mesh, {.triangles = wanted}, 25'000, 2, &stats);
    EXPECT_TRUE(stats.reached);
    EXPECT_EQ(stats.triangles_before, mesh.triangles.size());
    EXPECT_EQ(stats.triangles_after, fewer.triangles.size());
    EXPECT_LE(fewer.triangles.size(), wanted);
    EXPECT_GE(fewer.triangles.size(), wanted - wanted / 50);
    expect_same_topology(fewer, mesh);
    const double apart = compare(held, mesh, {100'000}).b_to_a->rms;
    EXPECT_LE(compare(fewer, mesh, {100'000}).b_to_a->rms, 1.25 * apart + 1e-9);
    for (std::size_t v = 0; v < fewer.positions.size(); ++v)
      ASSERT_NEAR(fewer.attributes[0][v], 200 * fewer.positions[v][1], 4);
  }
}

TEST(StreamedSimplify, IsTheSameForAnyThreads) {
  for (const SimplifySettings& goal :
       {SimplifySettings{.ratio = 0.4}, SimplifySettings{.triangles = 5000}, SimplifySettings{.error = 1e-3}}) {
    const TriangleMesh mesh = coloured_wave(goal.error > 0 ? 50 : 150);
    const std::uint64_t region = mesh.triangles.size() / 4;
    const TriangleMesh one = in_regions(mesh, goal, region, 1);
    for (const int threads : {2, 5}) {
      const TriangleMesh other = in_regions(mesh, goal, region, threads);
      EXPECT_EQ(one.positions, other.positions);
      EXPECT_EQ(one.triangles, other.triangles);
      EXPECT_EQ(one.attributes, other.attributes);
    }
  }
}

TEST(StreamedSimplify, TheBoundHoldsAcrossRegions) {
  const TriangleMesh mesh = coloured_wave(80);
  const double bound = 1e-3;
  const TriangleMesh fewer = in_regions(mesh, {.error = bound}, 4'000, 2);
  expect_same_topology(fewer, mesh);
  EXPECT_LT(4 * fewer.triangles.size(), mesh.triangles.size());
  const CompareResult r = compare(fewer, mesh, {100'000});
  EXPECT_LE(r.a_to_b->max, bound);
  EXPECT_LE(r.b_to_a->max, bound);
}

TEST(StreamedSimplify, APlaneOfManyRegions) {
  TriangleMesh mesh = coloured_wave(150);
  for (auto& p : mesh.positions) p[2] = 0;
  const TriangleMesh fewer = in_regions(mesh, {.triangles = 600}, 9'000, 2);
  EXPECT_LE(fewer.triangles.size(), 600U);
  expect_same_topology(fewer, mesh);
  EXPECT_NEAR(measure_mesh(fewer).area, measure_mesh(mesh).area, 1e-2);
}

TEST(StreamedSimplify, RefusesWhatIsNotManifold) {
  const TriangleMesh mesh = coloured_wave(60);
  TriangleMesh broken = mesh;
  broken.triangles.push_back(broken.triangles[3000]);
  expect_error(ExitCode::unreadable, [&] { in_regions(broken, {.ratio = 0.5}, 3000, 1); }, {"not manifold"});
  broken = mesh;
  broken.triangles[100][1] = broken.triangles[100][0];
  expect_error(ExitCode::unreadable, [&] { in_regions(broken, {.ratio = 0.5}, 3000, 1); }, {"not manifold", "100"});
  broken = mesh;
  broken.triangles[100][1] = 1'000'000;
  expect_error(ExitCode::unreadable, [&] { in_regions(broken, {.ratio = 0.5}, 3000, 1); }, {"1000000", "triangle 100"});
}

TEST(StreamedSimplify, RefusesGoalsThatMakeNoSense) {
  const TriangleMesh mesh = coloured_wave(10);
  const auto goal = [&](const SimplifySettings& s) { in_regions(mesh, s, 100, 1); };
  expect_error(ExitCode::usage, [&] { goal({}); }, {"at least one triangle"});
  expect_error(ExitCode::usage, [&] { goal({.triangles = 100'000}); }, {"100000", "the mesh has"});
  expect_error(ExitCode::usage, [&] { goal({.ratio = 1.5}); }, {"1.5", "up to 1"});
  expect_error(ExitCode::usage, [&] { goal({.triangles = 5, .error = 1}); }, {"not both"});
}

}  // namespace
}  // namespace lamina::simplify

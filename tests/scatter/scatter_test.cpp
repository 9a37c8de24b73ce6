#include "lamina/scatter.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <vector>

#include "meshes/mesh_files.h"
#include "meshes/vec3.h"

namespace lamina {
namespace {

using namespace testing_meshes;
using namespace meshes;

ScatterSettings with(std::uint64_t count) {
  ScatterSettings s;
  s.count = count;
  return s;
}

/// Sum of (observed - expected)^2 / expected: about the number of bins less one, give or take sqrt of twice that.
double chi_square(const std::vector<double>& observed, double expected) {
  double sum = 0;
  for (const double o : observed) sum += (o - expected) * (o - expected) / expected;
  return sum;
}

TriangleMesh scattered(const Surface& surface, const ScatterSettings& settings) {
  const ScratchFolder folder;
  scatter(surface, settings, folder.file("p.ply"));
  EXPECT_EQ(folder.entries(), 1u);
  return read_mesh(folder.file("p.ply"));
}

TEST(Scatter, MeshIsCoveredUniformlyWhateverItsTriangles) {
  // A square cut so that triangles differ 100-fold in area.
  TriangleMesh m;
  m.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.01, 0.5, 0}};
  m.triangles = {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}};
  const TriangleMesh cloud = scattered(*mesh_surface(m), with(100000));
  std::vector<double> bins(100);
  for (const auto& p : cloud.positions)
    ++bins[static_cast<std::size_t>(p[0] * 10) * 10 + static_cast<std::size_t>(p[1] * 10)];
  EXPECT_LT(chi_square(bins, 1000), 99 + 4 * std::sqrt(198));
  EXPECT_GT(chi_square(bins, 1000), 99 - 4 * std::sqrt(198));
  for (const auto& n : cloud.normals) EXPECT_EQ(n, (std::array<float, 3>{0, 0, 1}));
}

TEST(Scatter, InterpolatesNormalsAndColours) {
  TriangleMesh m = grid(1);
  m.layout = {{"red", ScalarType::float32}, {"green", ScalarType::float32}, {"blue", ScalarType::float32}};
  m.attributes = {{0, 1, 0, 1}, {0, 0, 1, 1}, {0.5, 0.5, 0.5, 0.5}};  // red is x, green is y
  m.normals = {{2, 0, 0}, {2, 0, 0}, {0, 0, 1}, {0, 0, 1}};           // turning from x to z along y
  const TriangleMesh cloud = scattered(*mesh_surface(m), with(2000));
  ASSERT_EQ(cloud.layout.size(), 3u);
  EXPECT_EQ(cloud.layout[1], (AttributeSpec{"green", ScalarType::uint8}));
  for (std::size_t i = 0; i < cloud.positions.size(); ++i) {
    const double x = cloud.positions[i][0], y = cloud.positions[i][1];
    EXPECT_NEAR(cloud.attributes[0][i], 255 * x, 0.51);
    EXPECT_NEAR(cloud.attributes[1][i], 255 * y, 0.51);
    EXPECT_NEAR(cloud.attributes[2][i], 127.5, 0.51);
    const Vec3 n = unit({1 - y, 0, y});
    EXPECT_LT(norm(to_double(cloud.normals[i]) - n), 1e-5);
  }
}

TEST(Scatter, NoiseIsUniformWithinHalfASpacing) {
  ScatterSettings s = with(20000);
  s.noise = 2;
  const TriangleMesh cloud = scattered(*mesh_surface(grid(1)), s);
  const double reach = 1.0 / std::sqrt(20000.0);  // 2 r / 2
  double squares = 0;
  for (const auto& p : cloud.positions) {
    EXPECT_LE(std::fabs(p[2]), reach * 1.0001);
    squares += p[2] * p[2];
  }
  EXPECT_NEAR(std::sqrt(squares / 20000), reach / std::sqrt(3.0), 0.02 * reach);
}

TEST(Scatter, DensityFallsByItsRatioAlongTheLongestAxis) {
  TriangleMesh m = grid(1);
  for (auto& p : m.positions) p[0] *= 3;
  ScatterSettings s = with(200000);
  s.density_ratio = 64;
  const TriangleMesh cloud = scattered(*mesh_surface(m), s);
  std::vector<double> bins(6);
  for (const auto& p : cloud.positions) ++bins[std::min<std::size_t>(5, static_cast<std::size_t>(p[0] * 2))];
  for (std::size_t k = 1; k < 6; ++k) EXPECT_NEAR(bins[k - 1] / bins[k], 2, 0.1) << "64 = 2^6 over six parts";
}

TEST(Scatter, BytesDependOnTheSeedNotOnThreads) {
  const ScratchFolder folder;
  const auto surface = shape_surface("statue", true);
  ScatterSettings s = with(70000);
  s.noise = 1;
  s.density_ratio = 8;
  RunContext run;
  run.threads = 1;
  scatter(*surface, s, folder.file("a.ply"), run);
  run.threads = 4;
  scatter(*surface, s, folder.file("b.ply"), run);
  EXPECT_EQ(bytes_of(folder.file("a.ply")), bytes_of(folder.file("b.ply")));
  s.seed = 2;
  scatter(*surface, s, folder.file("c.ply"), run);
  EXPECT_NE(bytes_of(folder.file("a.ply")), bytes_of(folder.file("c.ply")));
}

TEST(Scatter, DoublePositionsOnRequest) {
  const ScratchFolder folder;
  ScatterSettings s = with(10);
  s.double_positions = true;
  scatter(*shape_surface("sphere", false), s, folder.file("d.ply"));
  const TriangleMesh cloud = read_mesh(folder.file("d.ply"));
  for (const auto& p : cloud.positions) EXPECT_NEAR(norm(p), 1, 1e-15);
}

TEST(Scatter, NonsenseIsRefusedAndLeavesNothing) {
  const ScratchFolder folder;
  const auto sphere = shape_surface("sphere", false);
  const auto run = [&](ScatterSettings s, const std::string& name = "x.ply") {
    scatter(*sphere, s, folder.file(name));
  };
  expect_error(ExitCode::usage, [&] { run(with(0)); }, {"--count"});
  ScatterSettings s = with(10);
  s.noise = -1;
  expect_error(ExitCode::usage, [&] { run(s); }, {"--noise", "-1"});
  s = with(10);
  s.density_ratio = 0.5;
  expect_error(ExitCode::usage, [&] { run(s); }, {"--density-ratio"});
  expect_error(ExitCode::budget, [&] { run(with(10), "none/x.ply"); }, {"x.ply", "does not exist"});
  expect_error(ExitCode::usage, [] { shape_surface("klein", false); }, {"klein", "torus"});
  expect_error(ExitCode::unreadable, [] { mesh_surface(TriangleMesh{}); }, {"no triangles"});
  EXPECT_EQ(folder.entries(), 0u);
  const std::atomic<bool> cancel{true};
  RunContext cancelled;
  cancelled.cancel = &cancel;
  expect_error(ExitCode::internal, [&] { scatter(*sphere, with(10), folder.file("x.ply"), cancelled); }, {"cancelled"});
  EXPECT_EQ(folder.entries(), 0u);
}

}  // namespace
}  // namespace lamina

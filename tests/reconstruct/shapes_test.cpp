// The whole job on clouds whose surface is known.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "reconstruct/clouds.h"

namespace lamina {
namespace {

using test::Cloud;
using test::deviation;
using test::Point3;
using test::reconstruct;
using test::Reconstruction;

struct Variant {
  std::string name;
  SurfaceSettings settings;
};

SurfaceSettings with(const std::function<void(SurfaceSettings&)>& change) {
  SurfaceSettings s;
  change(s);
  return s;
}

std::vector<Variant> variants() {
  return {
      {"default", {}},
      {"cluster_none", with([](auto& s) { s.cluster = ClusterMode::none; })},
      {"cluster_free", with([](auto& s) { s.cluster = ClusterMode::free; })},
      {"steps_2", with([](auto& s) { s.steps = 2; })},
      {"steps_3", with([](auto& s) { s.steps = 3; })},
      {"blend_2", with([](auto& s) { s.blend = 2; })},
      {"blend_4", with([](auto& s) { s.blend = 4; })},
      {"diffuse", with([](auto& s) { s.diffuse = true; })},
      {"plane_fit", with([](auto& s) { s.fit = FitMode::plane; })},
      {"plane_steps_2", with([](auto& s) {
         s.fit = FitMode::plane;
         s.steps = 2;
       })},
      {"axis_frame", with([](auto& s) { s.frame = FrameMode::axis; })},
      {"cell_in_r", with([](auto& s) {
         s.cell = {0.8, Length::Unit::sample_radius};
       })},
      {"cell_in_world_units", with([](auto& s) {
         s.cell = {0.06, Length::Unit::world};
       })},
      {"levels_6", with([](auto& s) { s.levels = 6; })},
      {"particlescale", with([](auto& s) { s.radius_scale = 1.2; })},
      {"density_24", with([](auto& s) { s.density = 24; })},
      {"window_3", with([](auto& s) { s.window = 3; })},
  };
}

class EveryVariant : public ::testing::TestWithParam<Variant> {};
INSTANTIATE_TEST_SUITE_P(Surface, EveryVariant, ::testing::ValuesIn(variants()),
                         [](const auto& variant) { return variant.param.name; });

/// Normals are unit and point out of a star-shaped solid.
void expect_outward(const TriangleMesh& mesh) {
  ASSERT_EQ(mesh.normals.size(), mesh.positions.size());
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const Point3& p = mesh.positions[i];
    const auto& n = mesh.normals[i];
    ASSERT_NEAR(std::hypot(n[0], n[1], n[2]), 1, 1e-4);
    ASSERT_GT((p[0] * n[0] + p[1] * n[1] + p[2] * n[2]) / test::length(p), 0.95);
  }
}

// 6000 samples on the unit sphere lie 0.046 apart, r is about 0.09.
TEST_P(EveryVariant, SphereIsClosedAndRound) {
  const SurfaceSettings& s = GetParam().settings;
  const Reconstruction r = reconstruct(test::sphere_cloud(6000), s);
  EXPECT_TRUE(r.facts.boundary.empty()) << r.facts.boundary.size();
  if (s.cluster != ClusterMode::free) {  // free clustering may change the topology
    EXPECT_TRUE(r.facts.is_closed_manifold());
    EXPECT_EQ(r.facts.euler, std::vector<long>{2});
  }
  const auto d = deviation(r.mesh, test::distance_to_sphere);
  // A plane fit lies inside the curve by about R^2 / 8; triangles of two large cells sag.
  const double allowed = (s.fit == FitMode::plane ? 2 : 1) * std::pow(s.blend.value_or(1.2), 2) * 1e-3;
  EXPECT_LT(d.rms, allowed);
  EXPECT_LT(d.largest, 5 * allowed);
  EXPECT_NEAR(test::area(r.mesh), 4 * std::numbers::pi, 4 * std::numbers::pi * 3 * allowed);
  expect_outward(r.mesh);
  EXPECT_EQ(r.stats.vertices, r.mesh.positions.size());
  EXPECT_EQ(r.stats.triangles, r.mesh.triangles.size());
  EXPECT_EQ(r.stats.samples_read, 6000u);
  EXPECT_EQ(r.stats.plan.samples, 6000u);
  EXPECT_TRUE(r.stats.rejected.empty());
  RecordProperty("rms", std::to_string(d.rms) + " largest " + std::to_string(d.largest));
}

TEST(SurfaceShapes, TorusHasItsHandle) {
  const Reconstruction r = reconstruct(test::torus_cloud(10000));
  EXPECT_TRUE(r.facts.is_closed_manifold());
  EXPECT_EQ(r.facts.euler, std::vector<long>{0});
  const auto d = deviation(r.mesh, test::distance_to_torus);
  EXPECT_LT(d.rms, 2e-3);
  EXPECT_LT(d.largest, 1e-2);
  const double truth = 4 * std::numbers::pi * std::numbers::pi * test::kTorusMajor * test::kTorusMinor;
  EXPECT_NEAR(test::area(r.mesh), truth, 0.005 * truth);
}

TEST(SurfaceShapes, ClusteringKeepsTheTopology) {
  SurfaceSettings s;
  s.cluster = ClusterMode::none;
  const Reconstruction all = reconstruct(test::torus_cloud(10000), s);
  s.cluster = ClusterMode::preserving;
  const Reconstruction clustered = reconstruct(test::torus_cloud(10000), s);
  EXPECT_EQ(all.facts.euler, clustered.facts.euler);
  EXPECT_TRUE(all.facts.is_closed_manifold());
  EXPECT_LT(clustered.stats.triangles, 0.7 * static_cast<double>(all.stats.triangles));
  EXPECT_EQ(all.stats.triangles, all.stats.isotriangles);
}

// An open surface ends where its samples end, and nowhere else.
TEST(SurfaceShapes, PlaneIsOpenAtItsRimOnly) {
  const test::Plane plane;
  const Reconstruction r = reconstruct(test::plane_cloud(5000, plane));
  EXPECT_TRUE(r.facts.is_manifold());
  const double radius = r.stats.plan.radius_median;
  ASSERT_FALSE(r.facts.boundary.empty());
  double farthest = 0;
  for (const auto& edge : r.facts.boundary)
    farthest = std::max(farthest, plane.rim_distance(r.mesh.positions[edge[0]]));
  // An influence radius beyond the last samples, and the cell that takes the surface out of it.
  EXPECT_LT(farthest, 2.4 * radius);
  const auto d = deviation(r.mesh, [&](const Point3& p) { return std::abs(plane.height(p)); });
  // Isovertices keep a hundredth of a cell's distance from corners.
  EXPECT_LT(d.largest, 0.011 * 2 * r.stats.plan.finest_cell);
  EXPECT_GT(test::area(r.mesh), 4 * (1 - radius));
  EXPECT_LT(test::area(r.mesh), (2 + 2 * radius) * (2 + 2 * radius));
}

TEST(SurfaceShapes, HemisphereIsOpenAtItsRimOnly) {
  const Cloud cloud = test::sphere_cloud(6000, [](const Point3& v) { return v[0] > 0 ? 1.0 : 0.0; });
  const Reconstruction r = reconstruct(cloud);
  EXPECT_TRUE(r.facts.is_manifold());
  ASSERT_FALSE(r.facts.boundary.empty());
  double farthest = 0;
  for (const auto& edge : r.facts.boundary) farthest = std::max(farthest, std::abs(r.mesh.positions[edge[0]][0]));
  EXPECT_LT(farthest, 2 * r.stats.plan.radius_median);
  EXPECT_LT(deviation(r.mesh, test::distance_to_sphere).largest, 1e-2);
  // All of it is there, and no lid.
  double lowest = 1;
  for (const Point3& p : r.mesh.positions) lowest = std::min(lowest, p[0]);
  EXPECT_LT(lowest, 0.02);
  EXPECT_GT(lowest, -2 * r.stats.plan.radius_median);
}

// Density falls 64-fold from pole to pole: spacing, and with it the cells, grow eightfold.
TEST(SurfaceShapes, VaryingDensityUsesLevelsWithoutCracks) {
  const Cloud cloud = test::sphere_cloud(40000, [](const Point3& v) { return std::exp2(3 * (v[2] - 1)); });
  for (const bool diffuse : {false, true}) {
    const Reconstruction r = reconstruct(cloud, with([&](auto& s) { s.diffuse = diffuse; }));
    EXPECT_TRUE(r.facts.is_closed_manifold()) << r.facts.boundary.size();
    EXPECT_EQ(r.facts.euler, std::vector<long>{2});
    EXPECT_LT(deviation(r.mesh, test::distance_to_sphere).largest, 0.02);
    ASSERT_GE(r.stats.leaf_cells.size(), 4u);
    EXPECT_GE(std::count_if(r.stats.leaf_cells.begin(), r.stats.leaf_cells.end(), [](auto n) { return n > 100; }), 4);
    EXPECT_GT(r.stats.general_cells, 100u);
  }
}

TEST(SurfaceShapes, GivenRadiiAreObeyed) {
  Cloud cloud = test::sphere_cloud(6000);
  cloud.add_property("radius", ScalarType::float32, [](const Point3&) { return 0.12; });
  const Reconstruction r = reconstruct(cloud);
  EXPECT_TRUE(r.facts.is_closed_manifold());
  EXPECT_NEAR(r.stats.plan.radius_median, 0.12, 1e-6);
  EXPECT_NEAR(r.stats.plan.radius_high, 0.12, 1e-6);
  const Reconstruction scaled = reconstruct(cloud, with([](auto& s) { s.radius_scale = 1.5; }));
  EXPECT_NEAR(scaled.stats.plan.radius_median, 0.18, 1e-6);
  EXPECT_LT(scaled.stats.triangles, r.stats.triangles);
}

// Half the samples lie on a sphere 5 % too large; the quality says whom to believe.
TEST(SurfaceShapes, QualityIsTheWeight) {
  Cloud cloud = test::sphere_cloud(12000);
  for (std::size_t i = 0; i < cloud.size(); i += 2) {
    for (double& c : cloud.positions[i]) c *= 1.01;
  }
  const auto mean_radius = [](const Reconstruction& r) {
    double sum = 0;
    for (const Point3& p : r.mesh.positions) sum += test::length(p);
    return sum / static_cast<double>(r.mesh.positions.size());
  };
  const SurfaceSettings smooth = with([](auto& s) { s.blend = 2; });
  EXPECT_NEAR(mean_radius(reconstruct(cloud, smooth)), 1.005, 1.5e-3);
  for (const char* name : {"quality", "confidence"}) {
    for (const double scale : {1.0, 1e-30, 3e38}) {
      Cloud judged = cloud;
      judged.add_property(name, ScalarType::float32,
                          [&](const Point3& p) { return test::length(p) > 1.005 ? 0.001 * scale : scale; });
      EXPECT_NEAR(mean_radius(reconstruct(judged, smooth)), 1.0, 1.5e-3) << name << ' ' << scale;
    }
  }
}

TEST(SurfaceShapes, GeoreferencedCoordinatesKeepTheirDigits) {
  const Cloud near = test::sphere_cloud(6000);
  Cloud far = near;
  const Point3 shift{4e5, 5.6e6, 120};
  for (Point3& p : far.positions) {
    for (std::size_t k = 0; k < 3; ++k) p[k] += shift[k];
  }
  const test::TemporaryFolder folder;
  SurfaceSettings s;
  s.input = test::write_cloud(far, folder / "in.ply", PlyFormat::little_endian, ScalarType::float64);
  s.output = folder / "out.ply";
  reconstruct_surface(s, {});
  EXPECT_THAT(test::read_file(s.output).substr(0, 400), ::testing::HasSubstr("property double x"));
  TriangleMesh mesh = read_mesh(s.output);
  for (Point3& p : mesh.positions) {
    for (std::size_t k = 0; k < 3; ++k) p[k] -= shift[k];
  }
  EXPECT_TRUE(test::check_mesh(mesh.triangles).is_closed_manifold());
  EXPECT_LT(deviation(mesh, test::distance_to_sphere).largest, 5e-3);
}

// Corners around a sample with nobody near all lead to that sample: triangles between them would have no area.
TEST(SurfaceShapes, ALoneSampleMakesNoSurface) {
  Cloud cloud = test::sphere_cloud(4000);
  std::mt19937 random(3);
  for (int i = 0; i < 10; ++i) {
    const Point3 d = test::random_direction(random);
    cloud.add({2 * d[0], 2 * d[1], 2 * d[2]}, d);
  }
  cloud.add_property("radius", ScalarType::float32, [](const Point3&) { return 0.11; });
  const TriangleMesh mesh = reconstruct(cloud).mesh;
  EXPECT_TRUE(test::check_mesh(mesh.triangles).is_closed_manifold());
  EXPECT_LT(deviation(mesh, test::distance_to_sphere).largest, 5e-3);
}

// Coordinates no float can hold, at both ends.
TEST(SurfaceShapes, ExtremeSizes) {
  for (const double size : {1e-60, 1e-42, 1e42, 1e60}) {
    Cloud cloud = test::sphere_cloud(4000);
    for (Point3& p : cloud.positions) {
      for (double& c : p) c *= size;
    }
    const test::TemporaryFolder folder;
    SurfaceSettings s;
    s.input = test::write_cloud(cloud, folder / "in.ply", PlyFormat::little_endian, ScalarType::float64);
    s.output = folder / "out.ply";
    reconstruct_surface(s, {});
    const TriangleMesh mesh = read_mesh(s.output);
    EXPECT_TRUE(test::check_mesh(mesh.triangles).is_closed_manifold()) << size;
    const auto d = deviation(mesh, [&](const Point3& p) {
      return test::distance_to_sphere({p[0] / size, p[1] / size, p[2] / size});
    });
    EXPECT_LT(d.largest, 1e-2) << size;
  }
}

}  // namespace
}  // namespace lamina

// Gaps between samples: closed where the surface around tells how it goes on, left open and listed where not.
#include <gtest/gtest.h>

#include <fmt/format.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "lamina/chunk.h"
#include "lamina/error.h"
#include "reconstruct/clouds.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;
using test::Reconstruction;

constexpr double kRadius = 0.112;  ///< r of 4000 samples on the unit sphere

double angle_to(const Point3& p, const Point3& q) {
  return std::acos(std::clamp((p[0] * q[0] + p[1] * q[1] + p[2] * q[2]) / test::length(p), -1.0, 1.0));
}

/// The unit sphere without its samples around some points.
Cloud pierced_sphere(std::size_t count, const std::vector<Point3>& gaps, double angle) {
  return test::sphere_cloud(count, [&](const Point3& p) {
    return std::any_of(gaps.begin(), gaps.end(), [&](const Point3& g) { return angle_to(p, g) < angle; }) ? 0.0 : 1.0;
  });
}

SurfaceSettings closing(double radii) {
  SurfaceSettings s;
  s.close_holes = radii;
  return s;
}

TEST(Holes, OfASphereAreClosedOnTheSphere) {
  const Cloud cloud = pierced_sphere(4000, {{0.6, 0, 0.8}}, 0.25);
  const Reconstruction open = test::reconstruct(cloud, closing(0));
  ASSERT_GT(open.facts.boundary.size(), 8U);
  ASSERT_EQ(open.stats.holes.open, 1U);
  EXPECT_EQ(open.stats.holes.open_edges, open.facts.boundary.size());
  const OpenLoop& loop = open.stats.holes.longest.front();
  EXPECT_NEAR(loop.position[0], 0.6, 0.1);
  EXPECT_NEAR(loop.position[2], 0.8, 0.1);
  EXPECT_EQ(loop.edges, open.facts.boundary.size());

  const Reconstruction closed = test::reconstruct(cloud, closing(loop.radii + 0.1));
  EXPECT_TRUE(closed.facts.is_closed_manifold());
  EXPECT_EQ(closed.facts.euler, std::vector<long>{2});
  EXPECT_EQ(closed.stats.holes.closed, 1U);
  EXPECT_EQ(closed.stats.holes.open, 0U);
  EXPECT_TRUE(closed.stats.holes.longest.empty());
  EXPECT_LT(test::deviation(closed.mesh, test::distance_to_sphere).largest, 0.1 * kRadius);
  ASSERT_EQ(closed.mesh.triangles.size(), open.mesh.triangles.size() + closed.stats.holes.triangles);
  for (std::size_t t = open.mesh.triangles.size(); t < closed.mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = closed.mesh.triangles[t];
    const Point3 &p = closed.mesh.positions[a], &q = closed.mesh.positions[b], &r = closed.mesh.positions[c];
    const Point3 u{q[0] - p[0], q[1] - p[1], q[2] - p[2]}, v{r[0] - p[0], r[1] - p[1], r[2] - p[2]};
    const Point3 n{u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
    EXPECT_GT(n[0] * p[0] + n[1] * p[1] + n[2] * p[2], 0.9 * test::length(n)) << "faces the wrong way";
  }

  const Reconstruction left = test::reconstruct(cloud, closing(loop.radii - 0.1));
  EXPECT_EQ(left.facts.boundary.size(), open.facts.boundary.size());
}

TEST(Holes, OfAClosedThingAreAllClosedWhereAskedFor) {
  // Too wide for the bound.
  const std::vector<Point3> gaps{{0.6, 0, 0.8}, {-0.6, 0, 0.8}};
  const Cloud cloud = pierced_sphere(16000, gaps, 0.165);
  SurfaceSettings s = closing(8);
  s.watertight = false;
  const Reconstruction open = test::reconstruct(cloud, s);
  ASSERT_EQ(open.stats.holes.open, 2U);
  const double longest = open.stats.holes.longest.front().radii;
  ASSERT_GT(longest, 8);
  ASSERT_LT(longest, HoleSettings::kWatertight);
  s.watertight = true;
  const Reconstruction closed = test::reconstruct(cloud, s);
  EXPECT_TRUE(closed.facts.is_closed_manifold());
  EXPECT_EQ(closed.facts.euler, std::vector<long>{2});
  EXPECT_EQ(closed.stats.holes.closed, 2U);
  const Reconstruction wide = test::reconstruct(pierced_sphere(16000, gaps, 0.3), s);
  ASSERT_GT(wide.stats.holes.longest.front().radii, HoleSettings::kWatertight);
  EXPECT_EQ(wide.stats.holes.open, 2U) << "a long rim: an open thing";
}

/// A cube's surface about the origin, two wide, where `keep` says so.
Cloud cube_cloud(std::size_t count, const std::function<bool(const Point3&)>& keep) {
  std::mt19937 random(5);
  std::uniform_real_distribution<> uniform(-1, 1);
  Cloud cloud;
  while (cloud.size() < count) {
    const std::size_t axis = random() % 3;
    Point3 p{uniform(random), uniform(random), uniform(random)}, n{};
    p[axis] = n[axis] = p[axis] < 0 ? -1 : 1;
    if (keep(p)) cloud.add(p, n);
  }
  return cloud;
}

std::function<bool(const Point3&)> away_from_corner(double distance) {
  return [distance](const Point3& p) { return std::hypot(p[0] - 1, p[1] - 1, p[2] - 1) >= distance; };
}

bool beside_corner(const Point3& p) {
  return !away_from_corner(0.8)(p);
}

TEST(Holes, WithBentRimsAreBridgedWhereTheSurfaceLeadsIntoThem) {
  const Cloud cloud = cube_cloud(20000, away_from_corner(0.38));
  SurfaceSettings s = closing(300);
  s.watertight = false;
  const Reconstruction open = test::reconstruct(cloud, s);
  ASSERT_EQ(open.stats.holes.open, 1U);
  EXPECT_EQ(open.stats.holes.longest.front().reason, "bent");
  s.bridge = true;
  const Reconstruction bridged = test::reconstruct(cloud, s);
  EXPECT_TRUE(bridged.facts.is_closed_manifold());
  EXPECT_EQ(bridged.facts.euler, std::vector<long>{2});
  for (std::size_t v = open.mesh.positions.size(); v < bridged.mesh.positions.size(); ++v) {
    const Point3& p = bridged.mesh.positions[v];
    EXPECT_LT(std::max({p[0], p[1], p[2]}), 1.05);
    EXPECT_GT(p[0] + p[1] + p[2], 2.3) << "farther in than across the corner that is missing";
  }
  EXPECT_EQ(test::reconstruct(cube_cloud(20000, away_from_corner(0.95)), s).stats.holes.open, 1U) << "too wide";
  const auto open_above = [](const Point3& p) { return p[2] < 1; };
  EXPECT_EQ(test::reconstruct(cube_cloud(20000, open_above), s).stats.holes.open, 1U) << "a box without its lid";
}

TEST(Holes, WideOnesOfAClosedThingAreClosedWhereTheSurfaceLeadsIntoThem) {
  // Three faces end at the gap: no one surface goes on over it.
  const Cloud cloud = cube_cloud(20000, [](const Point3& p) { return !beside_corner(p); });
  SurfaceSettings s = closing(300);
  s.vertex_filled = true;
  const Reconstruction open = test::reconstruct(cloud, s);
  ASSERT_EQ(open.stats.holes.open, 1U);
  ASSERT_GT(open.stats.holes.longest.front().radii, HoleSettings::kWatertight);
  s.watertight = true;
  const Reconstruction closed = test::reconstruct(cloud, s);
  EXPECT_TRUE(closed.facts.is_closed_manifold());
  EXPECT_EQ(closed.facts.euler, std::vector<long>{2});
  const std::vector<float>& filled = closed.mesh.attributes.back();
  EXPECT_EQ(std::count(filled.begin(), filled.end(), 1.0F), static_cast<std::ptrdiff_t>(closed.stats.holes.vertices));

  const auto open_above = [](const Point3& p) { return p[2] < 1; };
  EXPECT_EQ(test::reconstruct(cube_cloud(20000, open_above), s).stats.holes.open, 1U) << "a box without its lid";
}

/// The unit sphere with a wide gap below, and a tube with an open end on one side.
Cloud sphere_with_tube(std::size_t count, double gap_angle, double tube_radius) {
  Cloud cloud = test::sphere_cloud(count, [&](const Point3& p) {
    const bool in_tube = p[0] > 0 && std::hypot(p[1], p[2]) < tube_radius;
    return in_tube || angle_to(p, {0, 0, -1}) < gap_angle ? 0.0 : 1.0;
  });
  const double begin = std::sqrt(1 - tube_radius * tube_radius);
  const double end = begin + 0.4;
  std::mt19937 random(7);
  std::uniform_real_distribution<> along(begin, end), around(0, 2 * std::numbers::pi);
  const auto samples = static_cast<std::size_t>(static_cast<double>(count) * tube_radius * (end - begin) / 2);
  for (std::size_t i = 0; i < samples; ++i) {
    const double angle = around(random), y = std::cos(angle), z = std::sin(angle);
    cloud.add({along(random), tube_radius * y, tube_radius * z}, {0, y, z});
  }
  return cloud;
}

TEST(Holes, WideOnesAreClosedAsMostOfTheirLengthSays) {
  SurfaceSettings s = closing(300);
  s.watertight = true;
  const Reconstruction closed = test::reconstruct(sphere_with_tube(30000, 1.2, 0.2), s);
  EXPECT_TRUE(closed.facts.is_closed_manifold()) << "the tube's end is a sixth of what is open";
  const Reconstruction open = test::reconstruct(sphere_with_tube(30000, 1.2, 0.45), s);
  EXPECT_EQ(open.stats.holes.open, 2U) << "the tube's end is a third of it";
  for (const OpenLoop& loop : open.stats.holes.longest) EXPECT_GT(loop.radii, HoleSettings::kWatertight);
}

TEST(Holes, OfPositionsAloneAreClosedUnasked) {
  const Cloud cloud = cube_cloud(20000, [](const Point3& p) { return !beside_corner(p); });
  const test::TemporaryFolder folder;
  std::string bare;
  for (const Point3& p : cloud.positions) bare += fmt::format("{} {} {}\n", p[0], p[1], p[2]);
  SurfaceSettings s = closing(0);
  s.close_holes.reset();
  s.blend.reset();
  s.normals = NormalsChoice::automatic;
  s.input = test::write_cloud(cloud, folder / "with_normals.ply");
  s.output = folder / "open.ply";
  EXPECT_EQ(reconstruct_surface(s, {}).holes.open, 1U) << "samples of a surface, which ends where they do";
  s.input = test::write_file(folder / "bare.xyz", bare);
  s.output = folder / "closed.ply";
  EXPECT_EQ(reconstruct_surface(s, {}).holes.open, 0U);
  EXPECT_TRUE(test::check_mesh(read_mesh(s.output).triangles).is_closed_manifold());
  // A store remembers that they had none.
  write_store(s, folder / "store", {});
  s.input = folder / "store";
  s.output = folder / "from_store.ply";
  reconstruct_surface(s, {});
  EXPECT_EQ(test::read_file(s.output), test::read_file(folder / "closed.ply"));
}

TEST(Holes, AreClosedWhereNobodySaysHowLong) {
  SurfaceSettings s = closing(8);
  s.close_holes.reset();
  s.vertex_filled = true;
  const Reconstruction r = test::reconstruct(pierced_sphere(16000, {{0.6, 0, 0.8}, {-0.6, 0, 0.8}}, 0.4), s);
  EXPECT_TRUE(r.facts.is_closed_manifold());
  EXPECT_EQ(r.stats.holes.closed, 2U);
  EXPECT_LT(test::deviation(r.mesh, test::distance_to_sphere).largest, 0.1 * kRadius);
  const std::vector<float>& filled = r.mesh.attributes.back();
  const std::size_t old = r.mesh.positions.size() - r.stats.holes.vertices;
  for (std::size_t v = 0; v < filled.size(); ++v) EXPECT_EQ(filled[v], v < old ? 0.0F : 1.0F);
}

TEST(Holes, AreClosedAroundIslands) {
  Cloud cloud = pierced_sphere(16000, {{0.6, 0, 0.8}}, 0.45);
  for (const Point3& p : test::sphere_cloud(16000).positions) {
    if (angle_to(p, {0.6, 0, 0.8}) < 0.15) cloud.add(p, p);
  }
  SurfaceSettings s = closing(300);
  s.prune_triangles = 10;
  const Reconstruction r = test::reconstruct(cloud, s);
  EXPECT_TRUE(r.facts.is_closed_manifold());
  EXPECT_EQ(r.facts.euler, std::vector<long>{2});
  EXPECT_EQ(r.stats.holes.closed, 2U) << "both loops of one gap";
  EXPECT_LT(test::deviation(r.mesh, test::distance_to_sphere).largest, 0.1 * kRadius);
}

TEST(Holes, CannotAllBeClosedWhereNoneAre) {
  SurfaceSettings s = closing(0);
  s.watertight = true;
  EXPECT_THROW(test::reconstruct(test::sphere_cloud(500), s), Error);
  s.close_holes = 8;
  s.cluster = ClusterMode::free;
  EXPECT_THROW(test::reconstruct(test::sphere_cloud(500), s), Error);
}

TEST(Holes, OfOpenThingsStayOpenWhateverIsAskedFor) {
  SurfaceSettings s = closing(8);
  s.watertight = true;
  EXPECT_EQ(test::reconstruct(test::plane_cloud(6000), s).facts.euler, std::vector<long>{1});
  // Its rim is short, but a good part of it.
  EXPECT_EQ(test::reconstruct(test::plane_cloud(60), s).facts.euler, std::vector<long>{1});
}

TEST(Holes, OuterRimsStayOpen) {
  const Reconstruction plane = test::reconstruct(test::plane_cloud(600), closing(1000));
  EXPECT_EQ(plane.facts.euler, std::vector<long>{1});
  ASSERT_EQ(plane.stats.holes.open, 1U);
  EXPECT_EQ(plane.stats.holes.longest.front().reason, "outer boundary");
  EXPECT_NEAR(plane.stats.holes.longest.front().length, 8, 1.5);
}

TEST(Holes, OfTwoNearSheetsAreNotJoined) {
  std::mt19937 random(4);
  std::uniform_real_distribution<> uniform(-1, 1);
  constexpr std::size_t kSamples = 2500;
  const double r = 2 * std::sqrt(4.0 / kSamples), apart = 2.5 * r;
  Cloud cloud;
  while (cloud.size() < 2 * kSamples) {
    const double side = cloud.size() < kSamples ? -1 : 1, u = uniform(random), v = uniform(random);
    if (std::hypot(u, v) > 2.2 * r) cloud.add({u, v, side * apart / 2}, {0, 0, side});
  }
  const Reconstruction open = test::reconstruct(cloud, closing(0));
  ASSERT_EQ(open.facts.euler, (std::vector<long>{0, 0}));
  const Reconstruction closed = test::reconstruct(cloud, closing(20));
  EXPECT_EQ(closed.stats.holes.closed, 2U);
  EXPECT_EQ(closed.facts.euler, (std::vector<long>{1, 1}));
  EXPECT_TRUE(closed.facts.is_manifold());
  for (const Point3& p : closed.mesh.positions) {
    if (std::hypot(p[0], p[1]) < 0.5) {
      EXPECT_NEAR(std::abs(p[2]), apart / 2, 0.1 * r);
    }
  }
}

TEST(Holes, PrunedPartsLeaveNone) {
  Cloud cloud = pierced_sphere(3000, {{0, 0.6, 0.8}}, 0.27);
  for (const Point3& p : test::sphere_cloud(40).positions) cloud.add({3 + 0.1 * p[0], 0.1 * p[1], 0.1 * p[2]}, p);
  SurfaceSettings s = closing(20);
  s.prune_triangles = 1000;
  const Reconstruction r = test::reconstruct(cloud, s);
  EXPECT_EQ(r.facts.euler, std::vector<long>{2});
  EXPECT_TRUE(r.facts.is_closed_manifold());
  EXPECT_EQ(r.stats.holes.closed, 1U);
}

TEST(Holes, AttributesAreCarriedOver) {
  Cloud cloud = pierced_sphere(3000, {{0, 0.6, 0.8}}, 0.27);
  cloud.add_property("height", ScalarType::float32, [](const Point3& p) { return p[2]; });
  SurfaceSettings s = closing(20);
  s.vertex_levels = true;
  const Reconstruction r = test::reconstruct(cloud, s);
  ASSERT_GT(r.stats.holes.vertices, 0U);
  for (std::size_t v = r.mesh.positions.size() - r.stats.holes.vertices; v < r.mesh.positions.size(); ++v)
    EXPECT_NEAR(static_cast<double>(r.mesh.attributes[0][v]), r.mesh.positions[v][2], 0.1);
}

/// Gaps at random make holes that are closed, left open, or run into each other; the mesh is manifold and the same
/// however it is made.
RC_GTEST_PROP(Holes, RandomGapsStayManifoldAndTheSameBytes, ()) {
  std::mt19937 random(*rc::gen::arbitrary<std::uint32_t>());
  std::uniform_real_distribution<> uniform;
  std::vector<Point3> gaps(5);
  for (Point3& gap : gaps) gap = test::random_direction(random);
  const Cloud cloud = pierced_sphere(1500, gaps, 0.3 + 0.25 * uniform(random));
  const test::TemporaryFolder folder;
  SurfaceSettings s = closing(*rc::gen::element(6.0, 8.0, 20.0, 300.0));
  s.watertight = *rc::gen::arbitrary<bool>();
  s.bridge = *rc::gen::arbitrary<bool>();
  s.input = test::write_cloud(cloud, folder / "in.ply");
  s.output = folder / "out.ply";
  RunContext run;
  run.threads = 1;
  const SurfaceStats stats = reconstruct_surface(s, run);
  const std::string whole = test::read_file(s.output);
  const TriangleMesh mesh = read_mesh(s.output);
  const test::MeshFacts facts = test::check_mesh(mesh.triangles);
  RC_ASSERT(facts.is_manifold());
  RC_ASSERT(facts.boundary.size() == stats.holes.open_edges);
  s.window = 3;
  run.threads = 2;
  reconstruct_surface(s, run);
  RC_ASSERT(test::read_file(s.output) == whole);

  write_store(s, folder / "store", run);
  s.input = folder / "store";
  const int count = *rc::gen::inRange(2, 9);
  std::vector<std::string> parts;
  for (int number = 1; number <= count; ++number) {
    s.output = folder / ("part" + std::to_string(number));
    reconstruct_chunk(s, {number, count}, run);
    parts.push_back(s.output);
  }
  const MergedParts merged = merge_parts(parts, {folder / "merged.ply"}, run);
  RC_ASSERT(test::read_file(folder / "merged.ply") == whole);
  RC_ASSERT(merged.holes.closed == stats.holes.closed);
  RC_ASSERT(merged.holes.open_edges == stats.holes.open_edges);
}

}  // namespace
}  // namespace lamina

// Simplification with a bound, against distances found another way.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "lamina/error.h"
#include "lamina/measure.h"
#include "lamina/simplify.h"
#include "meshes/mesh_files.h"
#include "meshes/vec3.h"
#include "simplify/cover.h"
#include "simplify/height_field.h"
#include "simplify/old_mesh.h"

namespace lamina {
namespace {

using namespace testing_meshes;
using namespace meshes;

/// By the plane where the foot of the perpendicular is inside, else by the sides.
double point_to_triangle(const Vec3& x, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 n = cross(b - a, c - a);
  if (dot(n, cross(b - a, x - a)) >= 0 && dot(n, cross(c - b, x - b)) >= 0 && dot(n, cross(a - c, x - c)) >= 0 &&
      norm(n) > 0)
    return std::abs(dot(n, x - a)) / norm(n);
  const auto to_side = [&](const Vec3& p, const Vec3& q) {
    const Vec3 s = q - p;
    const double t = dot(s, s) > 0 ? std::clamp(dot(x - p, s) / dot(s, s), 0.0, 1.0) : 0;
    return norm(x - p - t * s);
  };
  return std::min({to_side(a, b), to_side(b, c), to_side(c, a)});
}

/// The greatest distance of samples of one mesh to the other.
double farthest(const TriangleMesh& from, const TriangleMesh& to) {
  constexpr int kSteps = 4;
  double most = 0;
  for (const auto& t : from.triangles) {
    for (int i = 0; i <= kSteps; ++i) {
      for (int j = 0; i + j <= kSteps; ++j) {
        const double u = static_cast<double>(i) / kSteps, v = static_cast<double>(j) / kSteps;
        const Vec3 x = u * from.positions[t[0]] + v * from.positions[t[1]] + (1 - u - v) * from.positions[t[2]];
        double nearest = std::numeric_limits<double>::infinity();
        for (const auto& f : to.triangles)
          nearest = std::min(nearest, point_to_triangle(x, to.positions[f[0]], to.positions[f[1]], to.positions[f[2]]));
        most = std::max(most, nearest);
      }
    }
  }
  return most;
}

TriangleMesh rough_field(std::mt19937& random, std::uint32_t n) {
  const auto real = [&](double low, double high) { return std::uniform_real_distribution<>(low, high)(random); };
  const double wave = real(0, 12), height = real(0, 0.3), noise = real(0, 1) < 0.5 ? 0 : real(0, 0.5 / n);
  const auto hole = static_cast<std::uint32_t>(random() % (n * n));
  TriangleMesh mesh;
  for (std::uint32_t i = 0; i <= n; ++i) {
    for (std::uint32_t j = 0; j <= n; ++j) {
      const double x = static_cast<double>(i) / n, y = static_cast<double>(j) / n;
      mesh.positions.push_back({x + real(0, noise), y + real(0, noise),
                                height * std::sin(wave * x) * std::cos(wave * y) + real(-noise, noise)});
    }
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    for (std::uint32_t j = 0; j < n; ++j) {
      if (i * n + j == hole) continue;
      const std::uint32_t a = i * (n + 1) + j, b = a + n + 1;
      mesh.triangles.push_back({a, b, b + 1});
      mesh.triangles.push_back({a, b + 1, a + 1});
    }
  }
  return mesh;
}

/// Anything from a ball to a disc thinner than the bound.
TriangleMesh rough_ball(std::mt19937& random) {
  const auto real = [&](double low, double high) { return std::uniform_real_distribution<>(low, high)(random); };
  TriangleMesh mesh = sphere(1, 8, 16);
  const double flat = std::exp(real(-5, 0)), noise = real(0, 0.05) * flat;
  for (Vec3& p : mesh.positions) p = {p[0], p[1] + real(-noise, noise), flat * (p[2] + real(-noise, noise))};
  return mesh;
}

TEST(SimplifyBound, HoldsBothWays) {
  std::uint64_t before = 0, after = 0;
  for (unsigned seed = 0; seed < 100; ++seed) {
    std::mt19937 random(seed);
    const TriangleMesh mesh =
        seed % 3 == 0 ? rough_ball(random) : rough_field(random, static_cast<std::uint32_t>(4 + random() % 9));
    const double bound = std::exp(std::uniform_real_distribution<>(std::log(1e-4), std::log(0.4))(random));
    TriangleMesh fewer = mesh;
    const SimplifyStats stats = simplify_mesh(fewer, {0, bound});
    EXPECT_LE(farthest(mesh, fewer), bound) << seed;
    EXPECT_LE(farthest(fewer, mesh), bound) << seed;
    EXPECT_TRUE(stats.reached);
    const CheckReport was = check_mesh(mesh), is = check_mesh(fewer);
    EXPECT_TRUE(is.manifold()) << seed;
    EXPECT_EQ(is.euler_characteristic, was.euler_characteristic) << seed;
    EXPECT_EQ(is.boundary_loops, was.boundary_loops) << seed;
    before += mesh.triangles.size();
    after += fewer.triangles.size();
  }
  EXPECT_LT(4 * after, 3 * before);
}

TEST(SimplifyBound, IsUsedUp) {
  // More squares than a piece has.
  TriangleMesh mesh =
      test::height_field(112, [](double x, double y) { return 0.1 * std::sin(6 * x) * std::cos(6 * y); });
  TriangleMesh within = mesh, plain = mesh;
  RunContext one;
  one.threads = 1;
  simplify_mesh(within, {0, 1e-3}, one);
  const CompareResult held = compare(within, mesh, {50000});
  EXPECT_LE(held.a_to_b->max, 1e-3);
  EXPECT_LE(held.b_to_a->max, 1e-3);
  // The plain order reaches the bound no later than with as many triangles, a tenth granted.
  simplify_mesh(plain, {within.triangles.size() * 9 / 10});
  const CompareResult free = compare(plain, mesh, {50000});
  EXPECT_GT(std::max(free.a_to_b->max, free.b_to_a->max), 1e-3);
  TriangleMesh again = mesh;
  RunContext three;
  three.threads = 3;
  simplify_mesh(again, {0, 1e-3}, three);
  EXPECT_EQ(again.positions, within.positions);
  EXPECT_EQ(again.triangles, within.triangles);
}

// Where a contraction that was taken on trust turns out to go too far, it is not made again.
TEST(SimplifyBound, ALargerOneLeavesFewerTriangles) {
  TriangleMesh mesh = sphere(1, 48, 96);
  for (Vec3& p : mesh.positions) {
    const double turn = std::atan2(p[1], p[0]), lobes = 1 + 0.6 * std::sin(7 * turn) * std::cos(5 * p[2]);
    p = {lobes * p[0], lobes * p[1], 1.5 * p[2]};
  }
  std::size_t before = mesh.triangles.size();
  for (const double bound : {0.01, 0.03, 0.1, 0.3}) {
    TriangleMesh fewer = mesh;
    simplify_mesh(fewer, {0, bound});
    EXPECT_LT(fewer.triangles.size(), before) << bound;
    before = fewer.triangles.size();
  }
}

TEST(SimplifyBound, APlaneGoesAtAnyBound) {
  std::mt19937 random(1);
  TriangleMesh mesh = rough_field(random, 12);
  for (Vec3& p : mesh.positions) p[2] = 0;
  const std::size_t before = mesh.triangles.size();
  simplify_mesh(mesh, {0, 1e-9});
  EXPECT_LT(mesh.triangles.size(), before / 2);
}

/// Hundreds of triangles meet in a corner of a large flat part: what lies there is near all of them at once.
TEST(SimplifyBound, FlatPartsGoToTheirCreases) {
  std::mt19937 random(1);
  std::uniform_real_distribution<> noise(-1e-4, 1e-4);
  TriangleMesh mesh =
      test::height_field(120, [&](double x, double) { return 0.5 * std::abs(x - 0.5) + noise(random); });
  simplify_mesh(mesh, {0, 2e-4});
  EXPECT_LT(mesh.triangles.size(), 600);  // 1037 where only twelve of them are remembered
}

/// Where hundreds of triangles lie within the bound of any other.
TEST(SimplifyBound, OneOfManyEdgesLeavesLittle) {
  TriangleMesh cube = sphere(1, 96, 192);
  for (Vec3& p : cube.positions) p = (1 / std::max({std::abs(p[0]), std::abs(p[1]), std::abs(p[2])})) * p;
  for (const double bound : {0.05, 0.2, 0.8, 1e30}) {
    TriangleMesh fewer = cube;
    simplify_mesh(fewer, {0, bound});
    EXPECT_TRUE(check_mesh(fewer).manifold()) << bound;
    EXPECT_EQ(check_mesh(fewer).euler_characteristic, 2) << bound;
    EXPECT_LE(fewer.triangles.size(), 40U) << bound;
  }
}

/// Where proofs fail, contractions are taken back and others tried, between vertices that pieces have in common, too.
TEST(SimplifyBound, TopologyStaysWhereContractionsAreTakenBack) {
  // More squares than a piece has.
  TriangleMesh mesh =
      test::height_field(130, [](double x, double y) { return 0.05 * std::sin(40 * x) * std::cos(40 * y); });
  for (const double bound : {0.03, 0.06}) {
    TriangleMesh fewer = mesh;
    simplify_mesh(fewer, {0, bound});
    const CheckReport is = check_mesh(fewer);
    EXPECT_TRUE(is.manifold());
    EXPECT_EQ(is.euler_characteristic, 1);
    EXPECT_EQ(is.boundary_loops, 1U);
    EXPECT_LT(2 * fewer.triangles.size(), mesh.triangles.size());
    const CompareResult apart = compare(fewer, mesh, {20000});
    EXPECT_LE(std::max(apart.a_to_b->max, apart.b_to_a->max), bound);
  }
}

TEST(SimplifyBound, RefusesWhatIsNoLength) {
  TriangleMesh mesh = tetrahedron();
  for (const double error : {-1.0, std::nan(""), std::numeric_limits<double>::infinity()})
    expect_error(ExitCode::usage, [&] { simplify_mesh(mesh, {0, error}); }, {"error", "length above 0"});
  expect_error(ExitCode::usage, [&] { simplify_mesh(mesh, {2, 1.0}); }, {"not both"});
  expect_error(ExitCode::usage, [&] { simplify_mesh(mesh, {0, 0.0}); }, {"at least one triangle"});
}

/// Triangles over a rough field: what is said to be near is, by a bound that is nearly the least.
TEST(NearOld, SaysWhatIsTrue) {
  using simplify::NearOld;
  std::mt19937 random(5);
  std::uniform_real_distribution<> real(0, 1);
  int near = 0, seen = 0;
  for (int round = 0; round < 20; ++round) {
    TriangleMesh field = rough_field(random, 8);
    const simplify::OldMesh old(field.positions, field.triangles, std::vector<simplify::Errors>(field.triangles.size()),
                                0.5);
    NearOld near_old(old);
    for (int i = 0; i < 50; ++i) {
      TriangleMesh one;
      for (int k = 0; k < 3; ++k) one.positions.push_back({real(random), real(random), 0.2 * real(random)});
      one.triangles.push_back({0, 1, 2});
      if (cross(one.positions[1] - one.positions[0], one.positions[2] - one.positions[0])[2] < 0)
        std::swap(one.triangles[0][0], one.triangles[0][1]);
      const auto& t = one.triangles[0];
      const NearOld::Corners corners{one.positions[t[0]], one.positions[t[1]], one.positions[t[2]]};
      const auto begin = static_cast<std::uint32_t>(random() % field.triangles.size());
      const double truth = farthest(one, field);
      EXPECT_FALSE(near_old.prove(corners, begin, 0.999 * truth));
      if (!near_old.prove(corners, begin, 0.5)) continue;
      ++near;
      EXPECT_GE(static_cast<double>(near_old.error()), 0.999 * truth);
      if (near_old.look(corners, begin, 0.5) == NearOld::Answer::near) ++seen;
    }
  }
  EXPECT_GT(near, 400);
  EXPECT_GT(seen, 100);
}

/// Of a flat mesh, what is beyond its end or turned over is not.
TEST(NearOld, EndsWhereTheMeshEnds) {
  using simplify::NearOld;
  TriangleMesh square;
  square.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  square.triangles = {{0, 1, 2}, {0, 2, 3}};
  const simplify::OldMesh old(square.positions, square.triangles, std::vector<simplify::Errors>(2), 0.1);
  NearOld near_old(old);
  const Vec3 a{0.1, 0.1, 0.05}, b{0.9, 0.2, 0.05}, c{0.2, 0.8, 0.05};
  EXPECT_EQ(near_old.look({a, b, c}, 1, 0.06), NearOld::Answer::near);
  EXPECT_NEAR(near_old.error(), 0.05, 1e-6);
  EXPECT_EQ(near_old.used().size(), 2U);
  EXPECT_EQ(near_old.look({a, b, c}, 1, 0.04), NearOld::Answer::far);
  EXPECT_EQ(near_old.look({a, c, b}, 1, 0.06), NearOld::Answer::unclear);
  EXPECT_EQ(near_old.look({a, {1.05, 0.2, 0.05}, c}, 1, 0.06), NearOld::Answer::unclear);
  EXPECT_TRUE(near_old.prove({a, c, b}, 1, 0.06));                  // one way or the other it is near
  EXPECT_TRUE(near_old.prove({a, {1.03, 0.2, 0.05}, c}, 1, 0.06));  // by 0.058
  EXPECT_FALSE(near_old.prove({a, {1.05, 0.2, 0.05}, c}, 1, 0.06));
  // All of the square, corner on corner.
  EXPECT_EQ(near_old.look({Vec3{0, 0, 0}, Vec3{1, 0, 0}, Vec3{1, 1, 0}}, 1, 0.01), NearOld::Answer::near);
  EXPECT_EQ(near_old.used().size(), 1U);
}

TEST(Cover, DistanceIsTheDistance) {
  std::mt19937 random(3);
  std::uniform_real_distribution<> real(-1, 1);
  const auto any = [&] { return Vec3{real(random), real(random), real(random)}; };
  for (int i = 0; i < 2000; ++i) {
    const Vec3 a = any(), b = any(), c = i % 10 == 0 ? 0.5 * (a + b) : any(), x = any();
    const double truth = i % 10 == 0 ? point_to_triangle(x, a, b, b) : point_to_triangle(x, a, b, c);
    EXPECT_NEAR(simplify::distance_within(x, simplify::make_facet(a, b, c, {}), 10), truth, 1e-6);
    EXPECT_EQ(simplify::distance_within(x, simplify::make_facet(a, b, c, {}), 0.9 * truth - 1e-6),
              std::numeric_limits<double>::infinity());
  }
}

TEST(Cover, ATriangleLiesNearItsParts) {
  std::mt19937 random(4);
  std::uniform_real_distribution<> real(0, 1);
  for (int i = 0; i < 200; ++i) {
    const Vec3 a{0, 0, 0}, b{1, 0, 0}, c{0, 1, 0}, m{0.2 + 0.3 * real(random), 0.2 + 0.2 * real(random), 0};
    std::vector<simplify::Facet> parts{simplify::make_facet(a, b, m, {}), simplify::make_facet(b, c, m, {}),
                                       simplify::make_facet(c, a, m, {})};
    const auto near_parts = [&](simplify::Cover& cover, double error) {
      std::vector<const simplify::Facet*> list;
      for (const simplify::Facet& part : parts) list.push_back(&part);
      return cover.prove({a, b, c}, error, list, 30);
    };
    simplify::Cover cover(1e-6, {}, 2);
    EXPECT_TRUE(near_parts(cover, 0));
    EXPECT_LT(cover.error(), 1e-6);
    parts.pop_back();
    EXPECT_FALSE(near_parts(cover, 0));
    parts.push_back(simplify::make_facet(c, a, m + Vec3{0, 0, 0.01}, {}));
    EXPECT_FALSE(near_parts(cover, 0));
    simplify::Cover wider(0.011, {}, 2);
    EXPECT_TRUE(near_parts(wider, 0));
    EXPECT_FALSE(near_parts(wider, 0.01));
  }
}

}  // namespace
}  // namespace lamina

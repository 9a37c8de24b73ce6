#include "measure/triangle_bvh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "base/hashing.h"
#include "meshes/mesh_files.h"

namespace lamina::measure {
namespace {

using namespace meshes;

/// Triangles of every size, needles and repeated corners among them, far from the origin.
TriangleMesh soup(std::uint64_t seed, std::uint32_t triangles) {
  TriangleMesh m;
  CounterRng rng(seed, 0);
  for (std::uint32_t t = 0; t < triangles; ++t) {
    const Vec3 place{1000 + 5 * rng.symmetric(), -500 + 5 * rng.symmetric(), 5 * rng.symmetric()};
    const double size = std::pow(10, -4 * rng.uniform());
    for (int k = 0; k < 3; ++k)
      m.positions.push_back(place + size * Vec3{rng.symmetric(), rng.symmetric(), rng.symmetric()});
    m.triangles.push_back({3 * t, 3 * t + 1, 3 * t + (t % 17 == 0 ? 1 : 2)});
  }
  return m;
}

/// Nearest point by a fine search over the triangle: slow, and of another make.
double searched_distance(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  double best = std::numeric_limits<double>::infinity();
  constexpr int n = 200;
  for (int i = 0; i <= n; ++i)
    for (int j = 0; i + j <= n; ++j) {
      const double u = double(i) / n, v = double(j) / n;
      best = std::min(best, norm(p - ((1 - u - v) * a + u * b + v * c)));
    }
  return best;
}

TEST(PointTriangle, AgreesWithASearchOverTheTriangle) {
  for (std::uint64_t i = 0; i < 200; ++i) {
    CounterRng rng(7, i);
    const auto point = [&] { return Vec3{rng.symmetric(), rng.symmetric(), rng.symmetric()}; };
    const Vec3 p = 2.0 * point(), a = point(), b = point(), c = i % 10 == 0 ? b : point();
    const double exact = std::sqrt(squared_distance_to_triangle(p, a, b, c)), searched = searched_distance(p, a, b, c);
    EXPECT_LE(exact, searched + 1e-12);
    EXPECT_NEAR(exact, searched, 0.02);
  }
}

TEST(TriangleBvh, DistanceIsThatOfBruteForce) {
  const TriangleMesh m = soup(1, 3000);
  const TriangleBvh tree(m);
  for (std::uint64_t i = 0; i < 300; ++i) {
    CounterRng rng(2, i);
    const Vec3 p{1000 + 8 * rng.symmetric(), -500 + 8 * rng.symmetric(), 8 * rng.symmetric()};
    double best = std::numeric_limits<double>::infinity();
    for (const auto& t : m.triangles)
      best = std::min(best, squared_distance_to_triangle(p, m.positions[t[0]], m.positions[t[1]], m.positions[t[2]]));
    EXPECT_EQ(tree.distance(p), std::sqrt(best));
    const NearestTriangle nearest = tree.nearest(p);
    const auto& t = m.triangles[nearest.triangle];
    EXPECT_EQ(squared_distance_to_triangle(p, m.positions[t[0]], m.positions[t[1]], m.positions[t[2]]), best);
    EXPECT_EQ(tree.nearest(p, 1.001 * nearest.distance).triangle, nearest.triangle);
    EXPECT_GE(tree.nearest(p, 0.999 * nearest.distance).distance, 0.998 * nearest.distance) << "nothing lies nearer";
  }
}

TEST(TriangleBvh, FirstHitOfASphereIsWhereItMustBe) {
  const TriangleMesh m = testing_meshes::sphere(2, 100, 200);
  const TriangleBvh tree(m);
  for (std::uint64_t i = 0; i < 500; ++i) {
    CounterRng rng(3, i);
    const double x = 2.5 * rng.symmetric(), y = 2.5 * rng.symmetric(), rho2 = x * x + y * y;
    const auto hit = tree.first_hit({x, y, 10}, {0, 0, -1});
    if (rho2 > 4.0) {
      EXPECT_FALSE(hit.has_value());
    } else if (rho2 < 3.5) {
      ASSERT_TRUE(hit.has_value());
      EXPECT_NEAR(hit->distance, 10 - std::sqrt(4 - rho2), 0.01);
      const auto& t = m.triangles[hit->triangle];
      const Vec3 at = hit->weights[0] * m.positions[t[0]] + hit->weights[1] * m.positions[t[1]] +
                      hit->weights[2] * m.positions[t[2]];
      EXPECT_LT(norm(at - Vec3{x, y, 10 - hit->distance}), 1e-12);
    }
  }
  EXPECT_FALSE(tree.first_hit({0, 0, 10}, {0, 0, 1}).has_value()) << "behind";
}

TEST(TriangleBvh, EqualCentresDoNotBreakTheBuild) {
  TriangleMesh m;
  m.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  m.triangles.assign(5000, {0, 1, 2});
  EXPECT_EQ(TriangleBvh(m).distance({0.2, 0.2, 3}), 3);
  EXPECT_EQ(TriangleBvh(m).first_hit({0.2, 0.2, 3}, {0, 0, -1})->triangle, 0u);
}

}  // namespace
}  // namespace lamina::measure

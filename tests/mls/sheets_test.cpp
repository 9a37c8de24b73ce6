#include "mls/sheets.h"

#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace lamina {
namespace {

using meshes::Vec3;
using meshes::operator+;
using meshes::operator-;
using meshes::operator*;
using meshes::cross;
using meshes::dot;
using meshes::norm;
using meshes::unit;

double number(double low, double high) {
  return low + (high - low) * *rc::gen::inRange(0, 1000001) / 1e6;
}
Vec3 direction() {
  return unit(Vec3{number(-1, 1), number(-1, 1), number(0.1, 1)});
}

/// A plane at so far from the corner, with samples about `mean`, which is put on it.
Sheet plane(const Vec3& normal, double distance, const Vec3& mean, double share) {
  Sheet s;
  s.normal = normal;
  s.point = -distance * normal;
  s.mean = mean - (dot(normal, mean) + distance) * normal;
  s.share = share;
  return s;
}

/// Two half planes that meet in an edge through `at`.
struct Wedge {
  Vec3 at{}, along{};
  std::array<Vec3, 2> normal{}, into{};  ///< into: from the edge, in the half plane

  [[nodiscard]] double distance(const Vec3& x) const {
    double best = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < 2; ++k) {
      const Vec3 w = x - at;
      const Vec3 flat = w - dot(w, normal[k]) * normal[k];
      const double inward = dot(flat, into[k]);
      best = std::min(best, inward >= 0 ? std::abs(dot(w, normal[k])) : norm(w - dot(w, along) * along));
    }
    return best;
  }
};

Wedge random_wedge(bool convex) {
  Wedge w;
  w.at = {number(-0.9, 0.9), number(-0.9, 0.9), number(-0.9, 0.9)};
  w.along = direction();
  const Vec3 u = unit(cross(w.along, Vec3{0.3, -0.5, 0.2}));
  const Vec3 v = cross(w.along, u);
  const double half = number(0.25, 1.1);  // of the angle between the normals
  for (std::size_t k = 0; k < 2; ++k) {
    const double side = k == 0 ? 1 : -1;
    w.normal[k] = std::cos(half) * u + (side * std::sin(half)) * v;
    w.into[k] = (convex ? -std::sin(half) : std::sin(half)) * u + ((convex ? 1 : -1) * side * std::cos(half)) * v;
  }
  return w;
}

std::array<Sheet, 3> sheets_of(const Wedge& w) {
  std::array<Sheet, 3> sheets;
  for (std::size_t k = 0; k < 2; ++k)
    sheets[k] = plane(w.normal[k], -dot(w.normal[k], w.at), w.at + number(0.2, 0.8) * w.into[k], k == 0 ? 0.4 : 0.6);
  return sheets;
}

void check_wedge(bool convex) {
  const Wedge w = random_wedge(convex);
  SheetsValue value;
  RC_ASSERT(combine_sheets(sheets_of(w), 2, value));
  // A foot counts while it lies a thousandth off the other sheet: past the edge by up to that over the angle's sine, at
  // least 0.47 here.
  RC_ASSERT(std::abs(std::abs(value.distance) - w.distance({})) < 2.2e-3);
  // The surface point that distance and normal lead to is on the wedge.
  RC_ASSERT(w.distance(-value.distance * value.normal) < 2.2e-3);
  const double a = -dot(w.normal[0], w.at);
  const double b = -dot(w.normal[1], w.at);
  const double inside = convex ? std::max(a, b) : std::min(a, b);
  RC_ASSERT((value.distance < 0) == (inside < 0));
  if (value.creased) {
    RC_ASSERT(std::abs(dot(w.normal[0], value.crease - w.at)) < 1e-6);
    RC_ASSERT(std::abs(dot(w.normal[1], value.crease - w.at)) < 1e-6);
    RC_ASSERT(std::abs(norm(value.crease) - norm(cross(w.at, w.along))) < 1e-6);
  }
}

RC_GTEST_PROP(Sheets, ConvexEdgesAreTheWedge, ()) {
  check_wedge(true);
}
RC_GTEST_PROP(Sheets, ConcaveEdgesAreTheWedge, ()) {
  check_wedge(false);
}

RC_GTEST_PROP(Sheets, TheMeanOfAnEdgesSamplesLiesOverTheEdge, ()) {
  // As many on either side, as far away: unfolded, they balance.
  const Wedge w = random_wedge(*rc::gen::arbitrary<bool>());
  const double far = number(0.2, 0.8);
  std::array<Sheet, 3> sheets;
  for (std::size_t k = 0; k < 2; ++k)
    sheets[k] = plane(w.normal[k], -dot(w.normal[k], w.at), w.at + far * w.into[k], 0.5);
  SheetsValue value;
  RC_ASSERT(combine_sheets(sheets, 2, value));
  const Vec3 mean = -value.distance * value.normal + value.lean;
  RC_ASSERT(norm(mean - w.at) < 2e-3);
}

TEST(Sheets, ACubesCornerIsFoundFromInsideAndOutside) {
  for (const double side : {-0.4, 0.3}) {
    std::array<Sheet, 3> sheets;
    for (std::size_t k = 0; k < 3; ++k) {
      Vec3 normal{};
      normal[k] = 1;
      Vec3 mean{side - 0.5, side - 0.5, side - 0.5};
      sheets[k] = plane(normal, -side, mean, 1.0 / 3);
    }
    SheetsValue value;
    ASSERT_TRUE(combine_sheets(sheets, 3, value));
    EXPECT_TRUE(value.creased);
    for (const double c : value.crease) EXPECT_NEAR(c, side, 1e-9);
    EXPECT_NEAR(value.distance, side > 0 ? -side : std::sqrt(3.0) * -side, 1e-9);
  }
}

TEST(Sheets, AStepsCornerJoinsTheOddPairFirst) {
  // Floor and riser meet in a concave edge; a wall beside both, in convex ones.
  std::array<Sheet, 3> sheets;
  sheets[0] = plane({0, 0, 1}, 0.2, {-0.5, -0.5, 0}, 0.4);   // floor at z = -0.2, for x < 0.1
  sheets[1] = plane({-1, 0, 0}, 0.1, {0, -0.5, 0.4}, 0.3);   // riser at x = 0.1, above it
  sheets[2] = plane({0, 1, 0}, -0.1, {-0.5, 0, -0.7}, 0.3);  // wall at y = 0.1, around their ends
  SheetsValue value;
  ASSERT_TRUE(combine_sheets(sheets, 3, value));
  // The corner is above the floor, before the riser and within the wall.
  EXPECT_GT(value.distance, 0);
  EXPECT_NEAR(value.distance, 0.1, 1e-9);
}

TEST(Sheets, SamplesOnBothSidesMakeNoEdge) {
  std::array<Sheet, 3> sheets;
  sheets[0] = plane({0, 0, 1}, 0, {-0.5, 0, 0}, 0.5);
  sheets[1] = plane({1, 0, 0}, 0, {0, 0, 0.5}, 0.5);  // above the first, which is below it
  SheetsValue value;
  EXPECT_FALSE(combine_sheets(sheets, 2, value));
}

RC_GTEST_PROP(Sheets, BentOnesAreSpheres, ()) {
  Sheet s;
  s.normal = direction();
  s.curvature = number(-0.3, 0.3);
  if (std::abs(s.curvature) < 1e-3) s.curvature = 1e-3;
  s.point = number(-1, 1) * s.normal;
  const Vec3 centre = s.point - (1 / s.curvature) * s.normal;
  const Vec3 x{number(-1, 1), number(-1, 1), number(-1, 1)};
  const double sign = s.curvature > 0 ? 1 : -1;
  RC_ASSERT(std::abs(s.at(x) - sign * (norm(x - centre) - 1 / std::abs(s.curvature))) < 1e-6);
  RC_ASSERT(norm(s.normal_at(x) - sign * unit(x - centre)) < 1e-9);
}

RC_GTEST_PROP(Sheets, CreasesArePackedWithinATenThousandth, ()) {
  const Vec3 place{number(-1, 1), number(-1, 1), number(-1, 1)};
  const Vec3 normal = unit(Vec3{number(-1, 1), number(-1, 1), number(-1, 1)} + Vec3{1e-3, 0, 0});
  const auto packed = packed_crease(place, normal);
  Vec3 place_back{};
  Vec3 normal_back{};
  RC_ASSERT(unpacked_crease(packed.data(), place_back, normal_back));
  for (std::size_t k = 0; k < 3; ++k) RC_ASSERT(std::abs(place[k] - place_back[k]) < 1e-4);
  RC_ASSERT(norm(normal - normal_back) < 5e-3);
}

TEST(Sheets, NothingIsPackedAsZero) {
  const std::array<float, 2> nothing{};
  Vec3 place{};
  Vec3 normal{};
  EXPECT_FALSE(unpacked_crease(nothing.data(), place, normal));
  EXPECT_NE(packed_crease({0, 0, 0}, {0, 0, 1}), nothing);
}

}  // namespace
}  // namespace lamina

// Surfaces that lie closer to each other than the samples' influence reaches.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>

#include "reconstruct/clouds.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;

constexpr std::size_t kSamples = 4000;  // of each sheet, on the square [-1, 1]^2: r is 0.063

/// Two sheets a distance apart; facing away from each other as the sides of a wall, or each other as those of a slit.
Cloud two_sheets(double apart, bool wall) {
  std::mt19937 random(4);
  std::uniform_real_distribution<> uniform(-1, 1);
  Cloud cloud;
  for (std::size_t i = 0; i < 2 * kSamples; ++i) {
    const double side = i < kSamples ? -1 : 1;
    const double u = uniform(random);
    cloud.add({u, uniform(random), side * apart / 2}, {0, 0, wall ? side : -side});
  }
  return cloud;
}

/// Whether it is a wall, and whether the support is chosen by the cloud (--blend auto).
class Sheets : public ::testing::TestWithParam<std::tuple<bool, bool>> {};
INSTANTIATE_TEST_SUITE_P(Surface, Sheets, ::testing::Combine(::testing::Bool(), ::testing::Bool()), [](const auto& of) {
  return std::string(std::get<0>(of.param) ? "Wall" : "Slit") + (std::get<1>(of.param) ? "Chosen" : "");
});

TEST_P(Sheets, OneAndAHalfRadiiApartDoNotMerge) {
  const double r = 2 * std::sqrt(4.0 / kSamples);
  const double apart = 1.5 * r;
  const auto [wall, chosen] = GetParam();
  SurfaceSettings settings;
  if (chosen) settings.blend.reset();
  const TriangleMesh mesh = test::reconstruct(two_sheets(apart, wall), settings).mesh;
  std::size_t inner = 0;
  for (const Point3& p : mesh.positions) {
    if (std::max(std::abs(p[0]), std::abs(p[1])) > 0.8) continue;  // the rims are another matter
    ++inner;
    EXPECT_NEAR(std::abs(p[2]), apart / 2, 0.1 * r);
  }
  EXPECT_GT(inner, 2000U);
  for (const auto& t : mesh.triangles) {
    const auto [low, high] = std::minmax({mesh.positions[t[0]][2], mesh.positions[t[1]][2], mesh.positions[t[2]][2]});
    if (std::max(std::abs(mesh.positions[t[0]][0]), std::abs(mesh.positions[t[0]][1])) > 0.8) continue;
    EXPECT_LT(high - low, apart / 2) << "from one sheet to the other";
  }
}

}  // namespace
}  // namespace lamina

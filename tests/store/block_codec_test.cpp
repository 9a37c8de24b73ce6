#include "store/block_codec.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <array>
#include <cmath>
#include <random>

namespace lamina {
namespace {

using Normal = std::array<float, 3>;

Normal there_and_back(const Normal& n) {
  std::array<std::uint16_t, 3> packed{};
  pack_normals({&n[0], &n[1], &n[2]}, 1, {&packed[0], &packed[1], &packed[2]});
  Normal out{};
  unpack_normals({&packed[0], &packed[1], &packed[2]}, 1, {&out[0], &out[1], &out[2]});
  return out;
}

RC_GTEST_PROP(UnitNormal, ComesBackAsExactlyAsFloats, (unsigned seed)) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  // Close to the planes of the axes too, where the octahedron has its edges and folds.
  const double flat = std::exp2(-static_cast<double>(random() % 40));
  for (int i = 0; i < 200; ++i) {
    std::array<double, 3> d{normal(random), normal(random), normal(random)};
    d[static_cast<std::size_t>(i % 3)] *= flat;
    const double length = std::hypot(d[0], d[1], d[2]);
    Normal n{};
    for (std::size_t k = 0; k < 3; ++k) n[k] = static_cast<float>(d[k] / length);
    const Normal out = there_and_back(n);
    for (std::size_t k = 0; k < 3; ++k) RC_ASSERT(std::abs(out[k] - n[k]) < 5e-7F);
    RC_ASSERT(std::abs(std::hypot(out[0], out[1], out[2]) - 1) < 5e-7F);
  }
}

TEST(UnitNormal, AlongTheAxesAndTheirDiagonalsIsExact) {
  for (int i = 0; i < 27; ++i) {
    const Normal n{static_cast<float>(i % 3 - 1), static_cast<float>(i / 3 % 3 - 1), static_cast<float>(i / 9 - 1)};
    const int axes = std::abs(i % 3 - 1) + std::abs(i / 3 % 3 - 1) + std::abs(i / 9 - 1);
    const Normal out = there_and_back(n);
    if (axes == 0) {
      EXPECT_EQ(out, (Normal{0, 0, 1}));
      continue;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      if (axes < 3) {
        EXPECT_FLOAT_EQ(out[k], n[k] / std::sqrt(static_cast<float>(axes)));
      }
      if (n[k] == 0) {
        EXPECT_EQ(out[k], 0) << i;
      }
      EXPECT_NEAR(out[k], n[k] / std::sqrt(static_cast<float>(axes)), 5e-7);
    }
  }
}

TEST(UnitNormal, AnyLengthWillDo) {
  for (const float length : {1e-12F, 1e-3F, 17.0F, 1e18F}) {
    const Normal out = there_and_back({0.6F * length, 0, -0.8F * length});
    EXPECT_NEAR(out[0], 0.6F, 5e-7);
    EXPECT_EQ(out[1], 0);
    EXPECT_NEAR(out[2], -0.8F, 5e-7);
  }
}

}  // namespace
}  // namespace lamina

#include "samples/consensus_plane.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace lamina {
namespace {

using Place = std::array<float, 3>;

double degrees_between(const Place& a, const Place& b) {
  const double c = double{a[0]} * b[0] + double{a[1]} * b[1] + double{a[2]} * b[2];
  return std::acos(std::min(1.0, c)) * 57.29577951308232;
}

/// Samples of the two faces z = 0, x < edge and x = edge, z < 0 of a block, around the origin.
std::vector<Place> block_edge(float edge, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> u(-1, 1);
  std::vector<Place> out;
  for (int i = 0; i < 70; ++i) {
    const Place top{u(random), u(random), 0};
    if (top[0] < edge && top[0] * top[0] + top[1] * top[1] < 1) out.push_back(top);
    const Place side{edge, u(random), u(random)};
    if (side[2] < 0 && side[0] * side[0] + side[1] * side[1] + side[2] * side[2] < 1) out.push_back(side);
  }
  return out;
}

// Normals that are interpolated from face to face, as vertex normals of a coarse mesh are.
TEST(ConsensusPlane, FindsItsOwnSideOfAnEdge) {
  ConsensusPlane plane;
  for (unsigned seed = 1; seed <= 50; ++seed) {
    plane.neighbours = block_edge(0.2F, seed);
    for (const float blur : {15.0F, 30.0F, 44.0F}) {
      const float a = blur / 57.29578F;
      Place normal{};
      ASSERT_TRUE(plane.find({std::sin(a), 0, std::cos(a)}, normal)) << seed;
      EXPECT_LT(degrees_between(normal, {0, 0, 1}), 1) << seed << ", blurred by " << blur;
    }
  }
}

TEST(ConsensusPlane, LeavesTrueNormalsAlone) {
  ConsensusPlane plane;
  for (unsigned seed = 1; seed <= 50; ++seed) {
    plane.neighbours = block_edge(0.2F, seed);
    Place normal{};
    EXPECT_FALSE(plane.find({0, 0, 1}, normal)) << seed;
  }
}

// On a sphere no plane has much more to say for it than that of the true normal.
TEST(ConsensusPlane, LeavesSpheresAlone) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> u(-1, 1);
  ConsensusPlane plane;
  for (int trial = 0; trial < 50; ++trial) {
    plane.neighbours.clear();
    constexpr float kRadius = 8;
    while (plane.neighbours.size() < 50) {
      const float x = u(random);
      const float y = u(random);
      const Place p{x, y, std::sqrt(kRadius * kRadius - x * x - y * y) - kRadius};
      if (p[0] * p[0] + p[1] * p[1] + p[2] * p[2] < 1) plane.neighbours.push_back(p);
    }
    Place normal{};
    if (plane.find({0, 0, 1}, normal)) {
      EXPECT_LT(degrees_between(normal, {0, 0, 1}), 1);
    }
  }
}

TEST(ConsensusPlane, BendsWithItsSide) {
  // A cylinder's mantle that ends at its flat top: the mantle's samples find the mantle's normal.
  std::mt19937 random(4);
  std::uniform_real_distribution<float> u(-1, 1);
  constexpr float kRadius = 10;
  ConsensusPlane plane;
  double sum = 0;
  for (int trial = 0; trial < 20; ++trial) {
    plane.neighbours.clear();
    for (int i = 0; i < 60; ++i) {
      const float y = u(random);
      const float z = u(random);
      const Place mantle{std::sqrt(kRadius * kRadius - y * y) - kRadius, y, z};
      if (z < 0.1F && mantle[0] * mantle[0] + y * y + z * z < 1) plane.neighbours.push_back(mantle);
      const Place top{u(random), u(random), 0.1F};
      if (top[0] < 0 && top[0] * top[0] + top[1] * top[1] < 0.98F) plane.neighbours.push_back(top);
    }
    Place normal{};
    ASSERT_TRUE(plane.find({0.819F, 0, 0.574F}, normal));
    sum += degrees_between(normal, {1, 0, 0});
  }
  EXPECT_LT(sum / 20, 1) << "of 35 degrees";
}

TEST(ConsensusPlane, WantsNeighbours) {
  ConsensusPlane plane;
  Place normal{};
  EXPECT_FALSE(plane.find({0, 0, 1}, normal));
  plane.neighbours = {{0.1F, 0, 0}, {0.2F, 0, 0}, {-0.3F, 0, 0}, {0.4F, 0, 0}, {0.5F, 0, 0}, {-0.6F, 0, 0}};
  EXPECT_FALSE(plane.find({0, 0, 1}, normal)) << "all on a line through the sample";
}

}  // namespace
}  // namespace lamina

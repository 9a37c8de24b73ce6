#include "levelset/band.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>

namespace lamina::volume {
namespace {

/// A brick of random planes, of which a random few are sources and others want values.
struct Case {
  std::unique_ptr<Brick> brick = std::make_unique<Brick>();
  BlockMask sources, wanted;

  explicit Case(std::uint32_t seed) {
    std::mt19937 random(seed);
    std::normal_distribution<float> normal;
    brick->extra.assign(512, 0);
    for (std::size_t at = 0; at < 512; ++at) {
      float x = normal(random), y = normal(random), z = normal(random);
      if (at % 5 == 0) x = 0;  // along a plane of the lattice
      if (at % 7 == 0) y = 0;
      const float length = std::sqrt(x * x + y * y + z * z);
      brick->plane[at] = Plane{x / length, y / length, z / length, normal(random)};
      brick->extra[at] = normal(random);
      (random() % 3 == 0 ? sources : wanted).set(static_cast<int>(at));
    }
  }
  [[nodiscard]] std::unique_ptr<Sums> sums() const {
    auto sums = std::make_unique<Sums>();
    sums->extra.resize(512);
    for (int at = 0; at < 512; ++at) sums->clear(at, 1);
    return sums;
  }
  /// Word for word what the band promises: away from the surface, less than sqrt(0.75) voxels sideways.
  [[nodiscard]] std::unique_ptr<Sums> truth() const {
    auto out = sums();
    for (int at = 0; at < 512; ++at) {
      if (!sources.test(at)) continue;
      const Plane p = brick->plane[static_cast<std::size_t>(at)];
      for (int dz = -1; dz <= 1; ++dz) {
        for (int dy = -1; dy <= 1; ++dy) {
          for (int dx = -1; dx <= 1; ++dx) {
            const int x = (at & 7) + dx, y = (at >> 3 & 7) + dy, z = (at >> 6) + dz;
            if (((x | y | z) & ~7) != 0 || !wanted.test(BlockMask::offset(x, y, z))) continue;
            const auto fx = static_cast<float>(dx), fy = static_cast<float>(dy), fz = static_cast<float>(dz);
            const float up = p[0] * fx + p[1] * fy + p[2] * fz;
            const float near = 0.75F - (fx * fx + fy * fy + fz * fz) + up * up;
            if (!(near > 0) || !(up * (p[3] < 0 ? -1.0F : 1.0F) > 0)) continue;
            out->add(BlockMask::offset(x, y, z), near * near * near * near, p + Plane{0, 0, 0, up}, *brick, at, 1);
          }
        }
      }
    }
    return out;
  }
};

TEST(BandGrowth, SumsAreThoseOfTheDefinition) {
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    const Case c(seed);
    const Targets targets(c.wanted, 0, 8);
    std::vector<Source> sources;
    for (int at = 0; at < 512; ++at) {
      if (!c.sources.test(at)) continue;
      const PairBits around = targets.around(at & 7, at >> 3 & 7, at >> 6);
      if (around.any())
        sources.push_back({c.brick.get(), around, static_cast<std::int16_t>(at), static_cast<std::int16_t>(at)});
    }
    const auto truth = c.truth();
    const auto sums = c.sums();
    extrapolate(sources, 1, *sums);
    for (std::size_t at = 0; at < 512; ++at) {
      ASSERT_EQ(sums->weight[at], truth->weight[at]) << "seed " << seed << ", voxel " << at;
      ASSERT_EQ(sums->extra[at], truth->extra[at]);
      for (int k = 0; k < 4; ++k) ASSERT_EQ(sums->total[at][k], truth->total[at][k]);
    }
  }
}

}  // namespace
}  // namespace lamina::volume

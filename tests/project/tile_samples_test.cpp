#include "project/tile_samples.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <random>
#include <set>

#include "support/random_cloud.h"

namespace lamina::test {
namespace {

/// Buckets with random supports; some samples are left out.
Batch random_batch(std::uint64_t seed, const Lattice& lattice, int buckets, std::size_t samples) {
  std::mt19937_64 random(seed);
  Batch out;
  for (int b = 0; b < buckets; ++b) {
    auto bucket = std::make_shared<ActiveBucket>();
    bucket->samples =
        random_cloud({Shape::scatter, samples, {0, 0, 0}, 20.0 * lattice.cell, 100, 100, 1, 0, 2}, seed + b);
    for (std::size_t i = 0; i < samples; ++i) {
      const std::uint64_t size = random() % 20;  // a few reach more places than there are tiles
      const double cells = std::uniform_real_distribution<double>(0.5, size == 0 ? 90 : size < 3 ? 9 : 3)(random);
      bucket->support.push_back(random() % 8 == 0 ? 0.0F : static_cast<float>(cells * lattice.cell));
      bucket->weight.push_back(static_cast<float>(random() % 100 + 1));
      bucket->level.push_back(static_cast<std::uint8_t>(random() % static_cast<unsigned>(lattice.levels)));
    }
    out.push_back(bucket);
  }
  return out;
}

struct Place {
  const ActiveBucket* bucket;
  std::size_t i;
};
std::vector<Place> places(const Batch& batch) {
  std::vector<Place> out;
  for (const auto& b : batch) {
    for (std::size_t i = 0; i < b->samples.size(); ++i) out.push_back({b.get(), i});
  }
  return out;
}

TEST(TileSamples, BinsHoldWhatReachesTheTile) {
  const Lattice lattice{48, 3};
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    const Batch batch = random_batch(seed, lattice, 1 + static_cast<int>(seed % 3), 150);
    const std::vector<Place> all = places(batch);
    for (int level = 0; level < 2; ++level) {
      // Every second block takes part.
      std::vector<Block> blocks;
      for (int i = 0; i < 216; i += 2) {
        const Block b{i % 6 - 3, i / 6 % 6 - 3, i / 36 - 3};
        blocks.push_back(b);
      }
      const std::int32_t first = -4;
      const std::int32_t end = first + lattice.layers(level);
      const float margin = seed % 2 == 0 ? 0.0F : 60.0F;
      const double shift = seed < 3 ? 0.0 : 0.5;
      const TileBins bins = bin_samples(lattice, level, batch, first, end, blocks, margin, shift);
      ASSERT_EQ(bins.begin.size(), blocks.size() + 1);
      ASSERT_EQ(bins.begin.front(), 0U);
      ASSERT_EQ(bins.begin.back(), bins.index.size());
      std::size_t held = 0;
      for (std::size_t t = 0; t < blocks.size(); ++t) {
        std::set<std::uint32_t> in;
        for (std::uint64_t k = bins.begin[t]; k < bins.begin[t + 1]; ++k) {
          if (k > bins.begin[t]) {
            ASSERT_LT(bins.index[k - 1], bins.index[k]) << "order";
          }
          in.insert(bins.index[k]);
        }
        held += in.size();
        for (std::uint32_t s = 0; s < all.size(); ++s) {
          const auto& [bucket, i] = all[s];
          const std::array<std::int32_t, 3> p{bucket->samples.x[i], bucket->samples.y[i], bucket->samples.z[i]};
          const double support = bucket->support[i];
          bool ball = false;  // a point of the tile lies within reach
          bool box = true;    // and one along each axis, to half a cell
          std::array<std::array<bool, 8>, 3> axis{};
          const std::array<std::int32_t, 3> base{blocks[t].x * 8, blocks[t].y * 8, blocks[t].z * 8};
          std::array<std::array<double, 8>, 3> away{};
          for (int a = 0; a < 3; ++a) {
            bool any = false;
            for (int c = 0; c < 8; ++c) {
              const std::int32_t at = base[a] + c;
              away[a][c] = std::abs((at + shift) * lattice.cell_size(level) - p[a]);
              axis[a][c] = a < 2 || (at >= first && at < end);
              any = any || (axis[a][c] && away[a][c] <= support + margin + 0.5 * lattice.cell_size(level));
            }
            box = box && any;
          }
          for (int c = 0; c < 512 && support > 0; ++c) {
            const int x = c & 7;
            const int y = (c >> 3) & 7;
            const int z = c >> 6;
            if (!axis[2][z]) continue;
            ball = ball || std::hypot(away[0][x], away[1][y], away[2][z]) < support + margin;
          }
          ASSERT_TRUE(!ball || in.contains(s)) << "a sample in reach is missing";
          ASSERT_TRUE(!in.contains(s) || (box && support > 0)) << "a sample out of reach";
        }
      }
      EXPECT_GT(held, 15U);
    }
  }
}

TEST(TileSamples, BinsDoNotDependOnThreads) {
  // More samples than one piece of work.
  const Lattice lattice{48, 3};
  const Batch batch = random_batch(1, lattice, 3, 30'000);
  std::vector<Block> blocks;
  for (int i = 0; i < 8; ++i) {
    blocks.push_back({(i & 1) - 1, ((i >> 1) & 1) - 1, (i >> 2) - 1});
  }
  std::vector<TileBins> found;
  for (const std::size_t n : {1U, 2U, 4U}) {
    const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, n);
    found.push_back(bin_samples(lattice, 0, batch, -4, 0, blocks, 0, 0));
    EXPECT_EQ(found.back().begin, found.front().begin);
    EXPECT_EQ(found.back().index, found.front().index);
    EXPECT_GT(found.back().index.size(), 5'000U);
  }
}

TEST(TileSamples, RowsHoldEverySampleOnceInCells) {
  const Lattice lattice{48, 3};
  std::mt19937_64 random(3);
  for (int level = 0; level < 3; ++level) {
    const Batch batch = random_batch(10 + level, lattice, 3, 80);
    const std::vector<Place> all = places(batch);
    const Block block{-1, 0, level - 1};
    std::vector<std::uint32_t> index;
    for (std::uint32_t s = 0; s < all.size(); ++s) {
      if (all[s].bucket->support[all[s].i] > 0 && random() % 3 != 0) index.push_back(s);
    }
    RowSamples rows;
    PackedBatch packed;
    pack(batch, lattice, packed);
    rows.gather(lattice, level, block, packed, index.data(), index.size(), 1.75F);
    const TileSamples& t = rows.samples();
    ASSERT_EQ(t.x.size(), index.size());
    const double a = lattice.cell_size(level);
    std::vector<bool> used(index.size(), false);
    double largest = 0;
    for (const std::uint32_t s : index) {
      const auto& [bucket, i] = all[s];
      const std::array<double, 3> p{bucket->samples.x[i] / a - block.x * 8, bucket->samples.y[i] / a - block.y * 8,
                                    bucket->samples.z[i] / a - block.z * 8};
      const double support = bucket->support[i] / a;
      const double band = 1.75 * lattice.cell_size(bucket->level[i]) / a;
      largest = std::max(largest, support);
      bool found = false;
      for (std::size_t k = 0; k < t.x.size() && !found; ++k) {
        // Random attributes tell samples apart.
        if (used[k] || t.attributes[0][k] != bucket->samples.attributes[0][i]) continue;
        found = used[k] = true;
        EXPECT_NEAR(t.x[k], p[0], 1e-5);
        EXPECT_NEAR(t.y[k], p[1], 1e-5);
        EXPECT_NEAR(t.z[k], p[2], 1e-5);
        EXPECT_EQ(t.nx[k], bucket->samples.nx[i]);
        EXPECT_EQ(t.ny[k], bucket->samples.ny[i]);
        EXPECT_EQ(t.nz[k], bucket->samples.nz[i]);
        EXPECT_NEAR(t.support[k], support, 1e-6 * support);
        EXPECT_NEAR(t.inv_support2[k], 1 / (support * support), 1e-6 / (support * support));
        EXPECT_NEAR(t.inv_band2[k], 1 / (band * band), 1e-6 / (band * band));
        EXPECT_EQ(t.weight[k], bucket->weight[i]);
        EXPECT_EQ(t.attributes[1][k], bucket->samples.attributes[1][i]);
      }
      ASSERT_TRUE(found);
    }
    for (int round = 0; round < 200; ++round) {
      const auto number = [&](double low, double high) {
        return static_cast<float>(std::uniform_real_distribution<double>(low, high)(random));
      };
      const float y = number(-2, 9);
      const float z = number(-2, 9);
      const float y_high = y + number(0, 3);
      const float z_high = z + number(0, 1);
      std::array<SampleRange, RowSamples::kRows> ranges{};
      const int n = rows.ranges(y, y_high, z, z_high, ranges.data());
      ASSERT_LE(n, RowSamples::kRows);
      std::vector<bool> covered(index.size(), false);
      for (int r = 0; r < n; ++r) {
        ASSERT_LT(ranges[r].begin, ranges[r].end);
        ASSERT_LE(ranges[r].end, index.size());
        if (r > 0) {
          ASSERT_LT(ranges[r - 1].end, ranges[r].begin);
        }
        for (std::uint32_t k = ranges[r].begin; k < ranges[r].end; ++k) covered[k] = true;
      }
      for (std::size_t k = 0; k < index.size(); ++k) {
        const bool reach =
            t.y[k] > y - largest && t.y[k] < y_high + largest && t.z[k] > z - largest && t.z[k] < z_high + largest;
        ASSERT_TRUE(!reach || covered[k]) << "y " << t.y[k] << " z " << t.z[k];
      }
    }
  }
}

}  // namespace
}  // namespace lamina::test

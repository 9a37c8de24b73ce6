#include "mls/row_samples.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <map>
#include <optional>
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
      bucket->band.push_back(static_cast<float>(1 + random() % 200));
    }
    out.push_back(bucket);
  }
  return out;
}

ClusteredBatch clustered(const Batch& batch, const Lattice& lattice) {
  ClusteredBatch out;
  for (const auto& bucket : batch)
    out.push_back(std::make_shared<const ClusteredBucket>(cluster_samples(*bucket, lattice)));
  return out;
}

/// Random attributes tell samples apart.
using Name = std::pair<float, float>;
Name name_of(const std::vector<std::vector<float>>& attributes, std::size_t i) {
  return {attributes[0][i], attributes[1][i]};
}

/// Distance from a sample to the nearest point of a tile's layers along an axis, in steps.
double away(std::int32_t at, std::int32_t first, std::int32_t last, double shift, double cell) {
  const double low = (first + shift) * cell;
  const double high = (last + shift) * cell;
  if (at >= low && at <= high) return std::abs(std::remainder(at - low, cell));
  return at < low ? low - at : at - high;
}

/// Cubes of four cells of the samples' levels that hold any.
std::size_t cubes_with_samples(const ActiveBucket& bucket, const Lattice& lattice) {
  std::set<std::array<std::int32_t, 4>> cubes;
  const LocalSamples& s = bucket.samples;
  for (std::size_t i = 0; i < s.size(); ++i) {
    if (bucket.support[i] <= 0) continue;
    const std::int32_t edge = 4 * lattice.cell_size(bucket.level[i]);
    cubes.insert({bucket.level[i], floor_div(s.x[i], edge), floor_div(s.y[i], edge), floor_div(s.z[i], edge)});
  }
  return cubes.size();
}

TEST(SampleClusters, HoldEverySampleOnceInsideTheirBox) {
  const Lattice lattice{48, 3};
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    // Enough, at times, for several pieces that threads work on.
    const Batch batch = random_batch(seed, lattice, 1, seed % 4 == 0 ? 5 * kSampleGrain + 7 : 300);
    const ActiveBucket& bucket = *batch.front();
    const ClusteredBucket c = cluster_samples(bucket, lattice);
    std::map<Name, std::size_t> left;
    for (std::size_t i = 0; i < bucket.samples.size(); ++i) {
      if (bucket.support[i] > 0) left[name_of(bucket.samples.attributes, i)] = i;
    }
    ASSERT_EQ(c.samples.size(), left.size());
    EXPECT_EQ(c.clusters.size(), cubes_with_samples(bucket, lattice));
    std::uint32_t end = 0;
    for (const SampleCluster& k : c.clusters) {
      ASSERT_EQ(k.begin, end);
      ASSERT_LT(k.begin, k.end);
      end = k.end;
      std::optional<std::size_t> before;
      for (std::uint32_t i = k.begin; i < k.end; ++i) {
        const auto found = left.find(name_of(c.attributes, i));
        ASSERT_NE(found, left.end());
        const std::size_t s = found->second;
        left.erase(found);
        ASSERT_TRUE(!before || *before < s) << "order";
        before = s;
        EXPECT_EQ(c.x[i], bucket.samples.x[s]);
        EXPECT_EQ(c.samples[i].nz, bucket.samples.nz[s]);
        EXPECT_EQ(c.support[i], bucket.support[s]);
        EXPECT_EQ(c.samples[i].weight, bucket.weight[s]);
        EXPECT_EQ(c.samples[i].band, bucket.band[s]);
        const std::array<std::int32_t, 3> p{c.x[i], c.y[i], c.z[i]};
        for (int a = 0; a < 3; ++a) {
          EXPECT_LE(k.low[a], static_cast<double>(p[a]) - static_cast<double>(c.support[i]));
          EXPECT_GE(k.high[a], static_cast<double>(p[a]) + static_cast<double>(c.support[i]));
        }
      }
    }
    EXPECT_EQ(end, c.samples.size());
    EXPECT_TRUE(left.empty());
  }
}

TEST(SampleClusters, OneOfAsManySamplesAsSeveralPiecesHoldIsOne) {
  const Lattice lattice{1 << 20, 1};
  const Batch batch = random_batch(3, lattice, 1, 4 * kSampleGrain);
  ActiveBucket bucket = *batch.front();
  for (auto* axis : {&bucket.samples.x, &bucket.samples.y, &bucket.samples.z}) {
    for (std::int32_t& v : *axis) v = (v & 0xFFFF) + 1;
  }
  bucket.support.assign(bucket.samples.size(), 1.0F);
  const ClusteredBucket c = cluster_samples(bucket, lattice);
  ASSERT_EQ(c.clusters.size(), 1U);
  EXPECT_EQ(c.clusters.front().end, bucket.samples.size());
}

TEST(SampleClusters, OfAbsurdExtentsAndCells) {
  // Corners of the whole fixed-point range, with the smallest and the largest cells.
  for (const Lattice lattice : {Lattice{1, 3}, Lattice{1 << 20, 9}}) {
    ActiveBucket bucket;
    for (int i = 0; i < 16; ++i) {
      const auto end = [i](int bit) { return ((i >> bit) & 1) != 0 ? (1 << 29) : -(1 << 29); };
      bucket.samples.x.push_back(end(0));
      bucket.samples.y.push_back(end(1));
      bucket.samples.z.push_back(end(2));
      for (auto* n : {&bucket.samples.nx, &bucket.samples.ny, &bucket.samples.nz}) n->push_back(1);
      bucket.support.push_back(i == 0 ? 3e9F : 10);
      bucket.weight.push_back(1);
      bucket.band.push_back(10);
      bucket.level.push_back(static_cast<std::uint8_t>(i % lattice.levels));
    }
    const ClusteredBucket c = cluster_samples(bucket, lattice);
    EXPECT_EQ(c.samples.size(), 16U);
    EXPECT_EQ(c.clusters.back().end, 16U);
    for (const SampleCluster& k : c.clusters) {
      for (std::uint32_t i = k.begin; i < k.end; ++i) EXPECT_LE(k.low[0], c.x[i]);
    }
  }
}

TEST(TileSamples, HoldWhatReachesTheTile) {
  const Lattice lattice{48, 3};
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    const Batch batch = random_batch(seed, lattice, 1 + static_cast<int>(seed % 3), 150);
    const ClusteredBatch in_clusters = clustered(batch, lattice);
    for (int level = 0; level < 2; ++level) {
      // Every second block takes part.
      std::vector<Block> blocks;
      for (int i = 0; i < 216; i += 2) blocks.push_back({i % 6 - 3, i / 6 % 6 - 3, i / 36 - 3});
      QueryLayers layers;
      layers.level = level;
      layers.first = -4;
      layers.end = layers.first + lattice.layers(level);
      layers.margin = seed % 2 == 0 ? 0.0F : 60.0F;
      layers.shift = seed < 3 ? 0.0F : 0.5F;
      const TileRuns bins = bin_clusters(lattice, layers, in_clusters, blocks);
      ASSERT_EQ(bins.begin.size(), blocks.size() + 1);
      ASSERT_EQ(bins.begin.back(), bins.runs.size());
      std::size_t held = 0;
      RowSamples rows;
      for (std::size_t t = 0; t < blocks.size(); ++t) {
        const Block& b = blocks[t];
        const std::int32_t z_first = std::max(b.z * 8, layers.first);
        const std::int32_t z_last = std::min(b.z * 8 + 7, layers.end - 1);
        if (z_first > z_last) {
          ASSERT_TRUE(bins.of(t).empty());
          continue;
        }
        rows.gather(lattice, layers, b, bins.of(t));
        std::multiset<Name> in;
        for (std::size_t k = 0; k < rows.size(); ++k) in.insert(name_of(rows.samples().attributes, k));
        held += in.size();
        const double cell = lattice.cell_size(level);
        const double shift = static_cast<double>(layers.shift);
        for (const auto& bucket : batch) {
          for (std::size_t i = 0; i < bucket->samples.size(); ++i) {
            const double support = static_cast<double>(bucket->support[i]);
            const double far = support + static_cast<double>(layers.margin);
            const LocalSamples& s = bucket->samples;
            // To the nearest point of the tile's lattice, and to the box of its points.
            const double x = away(s.x[i], b.x * 8, b.x * 8 + 7, shift, cell);
            const double y = away(s.y[i], b.y * 8, b.y * 8 + 7, shift, cell);
            const double z = away(s.z[i], z_first, z_last, shift, cell);
            const std::size_t times = in.count(name_of(s.attributes, i));
            ASSERT_LE(times, 1U);
            if (support > 0 && std::hypot(x, y, z) < far) {
              ASSERT_EQ(times, 1U) << "a sample in reach is missing";
            }
            const double slack = 0.01 * cell;
            const auto outside = [&](double v, double first, double last) {
              return v < (first + shift) * cell - far - slack || v > (last + shift) * cell + far + slack;
            };
            const bool beyond = outside(s.x[i], b.x * 8, b.x * 8 + 7) || outside(s.y[i], b.y * 8, b.y * 8 + 7) ||
                                outside(s.z[i], z_first, z_last);
            ASSERT_TRUE(times == 0 || (support > 0 && !beyond)) << "a sample out of reach";
          }
        }
      }
      EXPECT_GT(held, 15U);
    }
  }
}

TEST(TileSamples, BinsDoNotDependOnThreads) {
  const Lattice lattice{48, 3};
  const ClusteredBatch batch = clustered(random_batch(1, lattice, 8, 4'000), lattice);
  std::vector<Block> blocks;
  for (int i = 0; i < 8; ++i) blocks.push_back({(i & 1) - 1, ((i >> 1) & 1) - 1, (i >> 2) - 1});
  std::vector<TileRuns> found;
  for (const std::size_t n : {1U, 2U, 4U}) {
    const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, n);
    found.push_back(bin_clusters(lattice, {0, -4, 0, 0, 0}, batch, blocks));
    EXPECT_EQ(found.back().begin, found.front().begin);
    ASSERT_EQ(found.back().runs.size(), found.front().runs.size());
    for (std::size_t r = 0; r < found.back().runs.size(); ++r) {
      const lamina::Run& a = found.back().runs[r];
      const lamina::Run& b = found.front().runs[r];
      ASSERT_TRUE(a.from == b.from && a.begin == b.begin && a.end == b.end);
    }
    EXPECT_GT(found.back().runs.size(), 500U);
  }
}

TEST(TileSamples, RowsHoldSamplesInCells) {
  const Lattice lattice{48, 3};
  std::mt19937_64 random(3);
  for (int level = 0; level < 3; ++level) {
    const Batch batch = random_batch(10 + level, lattice, 3, 400);
    const ClusteredBatch in_clusters = clustered(batch, lattice);
    const Block block{-1, 0, level - 1};
    QueryLayers layers;
    layers.level = level;
    layers.first = block.z * 8;
    layers.end = layers.first + 8;
    std::map<Name, std::pair<const ActiveBucket*, std::size_t>> places;
    for (const auto& b : batch) {
      for (std::size_t i = 0; i < b->samples.size(); ++i) places[name_of(b->samples.attributes, i)] = {b.get(), i};
    }
    std::vector<lamina::Run> runs;
    for (const auto& b : in_clusters) {
      for (const SampleCluster& c : b->clusters) runs.push_back({b.get(), c.begin, c.end});
    }
    RowSamples rows;
    rows.gather(lattice, layers, block, runs);
    const TileSamples& t = rows.samples();
    ASSERT_GT(rows.size(), 20U);
    const double a = lattice.cell_size(level);
    double largest = 0;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const auto& [bucket, i] = places.at(name_of(t.attributes, k));
      const double support = static_cast<double>(bucket->support[i]) / a;
      const double band = static_cast<double>(bucket->band[i]) / a;
      largest = std::max(largest, support);
      const TileSample& record = t.all[k];
      EXPECT_TRUE(record.x == t.x[k] && record.y == t.y[k] && record.z == t.z[k]);
      EXPECT_EQ(record.inv_support2, t.inv_support2[k]);
      EXPECT_NEAR(t.x[k], bucket->samples.x[i] / a - block.x * 8, 1e-5);
      EXPECT_NEAR(t.y[k], bucket->samples.y[i] / a - block.y * 8, 1e-5);
      EXPECT_NEAR(t.z[k], bucket->samples.z[i] / a - block.z * 8, 1e-5);
      EXPECT_EQ(record.nx, bucket->samples.nx[i]);
      EXPECT_EQ(record.ny, bucket->samples.ny[i]);
      EXPECT_EQ(record.nz, bucket->samples.nz[i]);
      EXPECT_NEAR(record.support, support, 1e-6 * support);
      EXPECT_NEAR(t.inv_support2[k], 1 / (support * support), 1e-6 / (support * support));
      EXPECT_NEAR(record.inv_band2, 1 / (band * band), 1e-6 / (band * band));
      EXPECT_EQ(record.weight, bucket->weight[i]);
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
      std::vector<bool> covered(t.all.size(), false);
      for (int r = 0; r < n; ++r) {
        ASSERT_LT(ranges[r].begin, ranges[r].end);
        ASSERT_LE(ranges[r].end, t.all.size());
        if (r > 0) {
          ASSERT_LT(ranges[r - 1].end, ranges[r].begin);
        }
        for (std::uint32_t k = ranges[r].begin; k < ranges[r].end; ++k) covered[k] = true;
      }
      for (std::size_t k = 0; k < t.all.size(); ++k) {
        const bool inside =
            t.y[k] > y - largest && t.y[k] < y_high + largest && t.z[k] > z - largest && t.z[k] < z_high + largest;
        ASSERT_TRUE(!inside || covered[k]) << "y " << t.y[k] << " z " << t.z[k];
      }
    }
  }
}

}  // namespace
}  // namespace lamina::test

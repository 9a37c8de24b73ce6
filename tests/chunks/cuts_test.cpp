#include "chunks/part_file.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <numeric>

#include "base/temporary_folder.h"

namespace lamina {
namespace {

double worst(const std::vector<double>& cost, const std::vector<SlabSpan>& spans, std::int32_t first) {
  double most = 0;
  for (const SlabSpan& s : spans) {
    if (s.empty()) continue;
    most = std::max(
        most, chunk_cost(cost, static_cast<std::size_t>(s.begin - first), static_cast<std::size_t>(s.end - first)));
  }
  return most;
}

/// The least that the largest of at most `count` chunks from slab `begin` on can cost, by trying all.
double best(const std::vector<double>& cost, std::size_t begin, int count) {
  if (begin == cost.size()) return 0;
  if (count == 1) return chunk_cost(cost, begin, cost.size());
  double least = chunk_cost(cost, begin, cost.size());
  for (std::size_t end = begin + 1; end < cost.size(); ++end)
    least = std::min(least, std::max(chunk_cost(cost, begin, end), best(cost, end, count - 1)));
  return least;
}

RC_GTEST_PROP(Cuts, FollowEachOtherAndAreAsEvenAsCanBe, ()) {
  const auto sizes = *rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 1000)).as("slabs");
  if (sizes.empty() || sizes.size() > 16) return;
  std::vector<double> cost(sizes.begin(), sizes.end());
  for (double& c : cost) c += 1;
  const int count = *rc::gen::inRange(1, 5);
  const std::int32_t first = *rc::gen::inRange(-1000, 1000);
  const std::vector<SlabSpan> spans = cut(cost, first, count);
  RC_ASSERT(spans.size() == static_cast<std::size_t>(count));
  std::int32_t end = first;
  bool empty = false;
  for (const SlabSpan& s : spans) {
    RC_ASSERT(s.begin == end);
    RC_ASSERT(s.end >= s.begin);
    RC_ASSERT(!empty || s.empty());
    empty = s.empty();
    end = s.end;
  }
  RC_ASSERT(end == first + static_cast<std::int32_t>(cost.size()));
  const double least = best(cost, 0, count);
  RC_ASSERT(worst(cost, spans, first) <= least * (1 + 1e-6));
}

TEST(Cuts, SlabsBesideAChunkCost) {
  const std::vector<double> cost(60, 1.0);
  EXPECT_DOUBLE_EQ(chunk_cost(cost, 0, 60), 60);
  EXPECT_DOUBLE_EQ(chunk_cost(cost, 30, 32), 2 + 0.7 * 25);
  EXPECT_DOUBLE_EQ(chunk_cost(cost, 0, 2), 2 + 0.7 * 12);
  // So the chunks at the ends are longer.
  const auto spans = cut(cost, 0, 3);
  EXPECT_GT(spans[0].end - spans[0].begin, spans[1].end - spans[1].begin);
}

TEST(Cuts, BucketsGiveTheirSamplesToTheSlabsTheyLieIn) {
  const test::TemporaryFolder folder;
  StoreSettings settings;
  settings.directory = folder.path();
  settings.z_min = -1000;
  settings.bucket_height = 300;
  settings.buckets = 7;
  SlabStoreWriter writer({}, settings);
  LocalSamples samples;
  for (std::int32_t z = -1000; z < 1000; ++z) {
    samples.x.push_back(0), samples.y.push_back(0), samples.z.push_back(z);
    samples.nx.push_back(0), samples.ny.push_back(0), samples.nz.push_back(1);
  }
  writer.append(samples);
  const SlabStore store = writer.finish();
  ReconstructionPlan plan;
  plan.lattice = {25, 3};
  plan.slabs = {-12, 12};
  const std::vector<double> counts = slab_samples(plan, store);
  EXPECT_NEAR(std::accumulate(counts.begin(), counts.end(), 0.0), 2000, 1e-6);
  for (std::int32_t s = -12; s < 12; ++s)
    EXPECT_NEAR(counts[static_cast<std::size_t>(s + 12)], s >= -10 && s < 10 ? 100 : 0, 1e-6) << s;
  EXPECT_EQ(samples_in(plan, store, {-3, 4}), 700u);
  EXPECT_EQ(samples_in(plan, store, {4, 4}), 0u);
}

}  // namespace
}  // namespace lamina

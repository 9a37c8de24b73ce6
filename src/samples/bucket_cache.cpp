#include "samples/bucket_cache.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <iterator>
#include <limits>
#include <utility>
#include <vector>

#include "base/vectors.h"
#include "lattice/lattice.h"

namespace lamina {
namespace {

constexpr int kBlockShift = 3;  ///< a block is eight cells wide

/// A block's place in the bucket's box and the sample's number, the place in the high half.
using BlockEntry = std::uint64_t;

struct Axis {
  std::int32_t low = 0;      ///< block of the lowest sample
  std::uint64_t blocks = 1;  ///< from there to the highest one
};

Axis axis_of(const std::vector<std::int32_t>& values, const FloorDivider& cell, int shift) {
  std::int32_t low = values.front();
  std::int32_t high = low;
  for (const std::int32_t v : values) {
    low = std::min(low, v);
    high = std::max(high, v);
  }
  Axis axis{cell(low) >> shift, 1};
  axis.blocks += static_cast<std::uint64_t>(std::int64_t{cell(high) >> shift} - axis.low);
  return axis;
}

/// The box of the blocks; `shift` is raised until each has a place below 2^32.
std::array<Axis, 3> box_of(const LocalSamples& s, const FloorDivider& cell, int& shift) {
  constexpr double kPlaces = 4294967296.0;
  for (;; ++shift) {
    const std::array<Axis, 3> box{axis_of(s.x, cell, shift), axis_of(s.y, cell, shift), axis_of(s.z, cell, shift)};
    const auto places =
        static_cast<double>(box[0].blocks) * static_cast<double>(box[1].blocks) * static_cast<double>(box[2].blocks);
    if (places <= kPlaces) return box;
  }
}

template <class T>
void permute(std::vector<T>& values, const std::vector<BlockEntry>& order, std::vector<T>& scratch) {
  if (values.empty()) return;
  resize_anew(scratch, values.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, order.size(), kSampleGrain), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) scratch[i] = values[static_cast<std::uint32_t>(order[i])];
  });
  values.swap(scratch);
}

}  // namespace

void sort_by_block(LocalSamples& s, const Lattice& lattice, BlockOrderScratch& scratch) {
  if (s.size() < 2 || s.size() > std::numeric_limits<std::uint32_t>::max()) return;
  const FloorDivider cell(lattice.cell);
  int shift = kBlockShift;
  const auto [x, y, z] = box_of(s, cell, shift);
  std::vector<BlockEntry>& order = scratch.order;
  resize_anew(order, s.size());
  bool sorted = true;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const auto place = [shift = shift](std::int32_t c, const Axis& axis) {
      return static_cast<std::uint64_t>(std::int64_t{c >> shift} - axis.low);
    };
    const std::uint64_t key =
        (place(cell(s.z[i]), z) * y.blocks + place(cell(s.y[i]), y)) * x.blocks + place(cell(s.x[i]), x);
    order[i] = key << 32 | i;
    sorted = sorted && (i == 0 || order[i - 1] <= order[i]);
  }
  if (sorted) return;
  digit_sort(order, scratch.other, x.blocks * y.blocks * z.blocks - 1, [](BlockEntry e) { return e >> 32; });
  for (auto* values : {&s.x, &s.y, &s.z}) permute(*values, order, scratch.integers);
  for (auto* values : {&s.nx, &s.ny, &s.nz, &s.radius, &s.quality}) permute(*values, order, scratch.floats);
  for (auto& values : s.attributes) permute(values, order, scratch.floats);
}

namespace {

std::size_t bytes_of(const LocalSamples& s) {
  constexpr std::size_t kAnnotation = 3 * sizeof(float) + 1;
  const std::size_t optional = (s.radius.empty() ? 0 : 1) + (s.quality.empty() ? 0 : 1) + s.attributes.size();
  return s.size() * ((6 + optional) * sizeof(float) + kAnnotation);
}

}  // namespace

BucketCache::BucketCache(const SlabStore& store, const Lattice& lattice, std::size_t budget_bytes)
    : store_(store), lattice_(lattice), budget_(budget_bytes) {}

BucketCache::~BucketCache() {
  tasks_.wait();
}

void BucketCache::load(std::size_t bucket, ActiveBucket& out) {
  store_.read(bucket, out.samples);
  // A thread that waits for others here must not begin with another bucket: the scratch is in use.
  tbb::this_task_arena::isolate([&] { sort_by_block(out.samples, lattice_, scratch_.local()); });
}

void BucketCache::prefetch(std::size_t bucket) {
  if (store_.count(bucket) == 0 || here_.contains(bucket) || incoming_.contains(bucket)) return;
  ++reads_;
  Incoming& incoming = incoming_[bucket];
  incoming.loaded = std::make_shared<ActiveBucket>();
  tasks_.run([this, bucket, &incoming] {
    try {
      load(bucket, *incoming.loaded);
    } catch (...) {
      incoming.error = std::current_exception();
    }
  });
}

std::shared_ptr<ActiveBucket> BucketCache::get(std::size_t bucket) {
  if (const auto hit = here_.find(bucket); hit != here_.end()) return hit->second;
  prefetch(bucket);
  std::shared_ptr<ActiveBucket> loaded;
  if (const auto coming = incoming_.find(bucket); coming != incoming_.end()) {
    tasks_.wait();
    const Incoming arrived = std::move(coming->second);
    incoming_.erase(coming);
    if (arrived.error) std::rethrow_exception(arrived.error);
    loaded = arrived.loaded;
  } else {
    loaded = std::make_shared<ActiveBucket>();  // an empty bucket is never read
    load(bucket, *loaded);
  }
  bytes_ += bytes_of(loaded->samples);
  here_.emplace(bucket, loaded);
  keep_within_budget(bucket);
  return loaded;
}

void BucketCache::keep_within_budget(std::size_t wanted) {
  while (bytes_ > budget_ && here_.size() > 1) {
    // The highest bucket is the one whose turn comes last.
    auto last = std::prev(here_.end());
    if (last->first == wanted) --last;
    drop(last->first);
  }
}

void BucketCache::drop(std::size_t bucket) {
  if (const auto coming = incoming_.find(bucket); coming != incoming_.end()) {
    tasks_.wait();
    incoming_.erase(coming);
  }
  const auto found = here_.find(bucket);
  if (found == here_.end()) return;
  bytes_ -= bytes_of(found->second->samples);
  here_.erase(found);
}

}  // namespace lamina

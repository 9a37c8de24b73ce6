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

template <class T, class Order>
void permute(std::vector<T>& values, const Order& order, std::vector<T>& scratch) {
  if (values.empty()) return;
  resize_anew(scratch, values.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, order.size(), kSampleGrain), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) scratch[i] = values[static_cast<std::uint32_t>(order[i])];
  });
  values.swap(scratch);
}

template <class Order>
void permute_all(LocalSamples& s, const Order& order, BlockOrderScratch& scratch) {
  for (auto* values : {&s.x, &s.y, &s.z}) permute(*values, order, scratch.integers);
  for (auto* values : {&s.nx, &s.ny, &s.nz, &s.radius, &s.quality}) permute(*values, order, scratch.floats);
  for (auto& values : s.attributes) permute(values, order, scratch.floats);
}

/// The order of sort_by_block(), in scratch.order; false: the samples are in it.
bool find_order(const LocalSamples& s, const Lattice& lattice, BlockOrderScratch& scratch) {
  if (s.size() < 2 || s.size() > std::numeric_limits<std::uint32_t>::max()) return false;
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
  if (sorted) return false;
  digit_sort(order, scratch.other, x.blocks * y.blocks * z.blocks - 1, [](BlockEntry e) { return e >> 32; });
  return true;
}

}  // namespace

void sort_by_block(LocalSamples& s, const Lattice& lattice, BlockOrderScratch& scratch) {
  if (find_order(s, lattice, scratch)) permute_all(s, scratch.order, scratch);
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

void BucketCache::load(std::size_t bucket, Columns wanted, Incoming& incoming) {
  LocalSamples& samples = incoming.loaded->samples;
  store_.read(bucket, samples, wanted);
  BlockOrderScratch scratch;
  // A thread that waits for others here must not begin with another bucket: that would be twice the scratch.
  tbb::this_task_arena::isolate([&] {
    if (wanted == Columns::all && incoming.order) {
      if (!incoming.order->empty()) permute_all(samples, *incoming.order, scratch);
      return;
    }
    incoming.order.emplace();
    if (!find_order(samples, lattice_, scratch)) return;
    permute_all(samples, scratch.order, scratch);
    if (wanted == Columns::positions) incoming.order->assign(scratch.order.begin(), scratch.order.end());
  });
}

void BucketCache::start(std::size_t bucket, Columns wanted, Arriving& among) {
  ++reads_;
  Incoming& incoming = among[bucket];
  if (const auto known = orders_.find(bucket); known != orders_.end()) {
    incoming.order = std::move(known->second);
    orders_.erase(known);
  }
  tasks_.run([this, bucket, wanted, &incoming] {
    try {
      load(bucket, wanted, incoming);
    } catch (...) {
      incoming.error = std::current_exception();
    }
  });
}

BucketCache::Incoming BucketCache::take(Arriving& from, std::size_t bucket) {
  const auto coming = from.find(bucket);
  if (coming == from.end()) {  // an empty bucket is never on its way
    Incoming empty;
    store_.read(bucket, empty.loaded->samples);
    return empty;
  }
  tasks_.wait();
  Incoming arrived = std::move(coming->second);
  from.erase(coming);
  if (arrived.error) std::rethrow_exception(arrived.error);
  return arrived;
}

void BucketCache::prefetch(std::size_t bucket) {
  if (store_.count(bucket) == 0 || here_.contains(bucket) || incoming_.contains(bucket)) return;
  start(bucket, Columns::all, incoming_);
}

void BucketCache::prefetch_positions(std::size_t bucket) {
  if (store_.count(bucket) == 0 || positions_.contains(bucket)) return;
  start(bucket, Columns::positions, positions_);
}

LocalSamples BucketCache::get_positions(std::size_t bucket) {
  prefetch_positions(bucket);
  Incoming arrived = take(positions_, bucket);
  if (arrived.order) orders_.insert_or_assign(bucket, std::move(*arrived.order));
  return std::move(arrived.loaded->samples);
}

std::shared_ptr<ActiveBucket> BucketCache::get(std::size_t bucket) {
  if (const auto hit = here_.find(bucket); hit != here_.end()) return hit->second;
  prefetch(bucket);
  std::shared_ptr<ActiveBucket> loaded = take(incoming_, bucket).loaded;
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
  orders_.erase(bucket);
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

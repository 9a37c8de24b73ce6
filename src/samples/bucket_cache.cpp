#include "samples/bucket_cache.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <iterator>
#include <utility>

namespace lamina {
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

void BucketCache::load(std::size_t bucket, Incoming& incoming) const {
  LocalSamples& samples = incoming.loaded->samples;
  store_.read(bucket, samples);
  BlockOrderScratch scratch;
  // A thread that waits for others here must not begin with another bucket: that would be twice the scratch.
  tbb::this_task_arena::isolate([&] {
    if (!incoming.order) incoming.order = order_by_block(samples, lattice_, scratch);
    put_in_order(samples, *incoming.order, scratch);
  });
}

void BucketCache::know_order(std::size_t bucket, BlockOrder order) {
  orders_.insert_or_assign(bucket, std::move(order));
}

void BucketCache::prefetch(std::size_t bucket) {
  if (store_.count(bucket) == 0 || here_.contains(bucket) || incoming_.contains(bucket)) return;
  ++reads_;
  Incoming& incoming = incoming_[bucket];
  if (const auto known = orders_.find(bucket); known != orders_.end()) {
    incoming.order = std::move(known->second);
    orders_.erase(known);
  }
  tasks_.run([this, bucket, &incoming] {
    try {
      load(bucket, incoming);
    } catch (...) {
      incoming.error = std::current_exception();
    }
  });
}

std::shared_ptr<ActiveBucket> BucketCache::take(std::size_t bucket) {
  const auto coming = incoming_.find(bucket);
  if (coming == incoming_.end()) return std::make_shared<ActiveBucket>();  // an empty one
  tasks_.wait();
  const Incoming arrived = std::move(coming->second);
  incoming_.erase(coming);
  if (arrived.error) std::rethrow_exception(arrived.error);
  return arrived.loaded;
}

std::shared_ptr<ActiveBucket> BucketCache::get(std::size_t bucket) {
  if (const auto hit = here_.find(bucket); hit != here_.end()) return hit->second;
  prefetch(bucket);
  std::shared_ptr<ActiveBucket> loaded = take(bucket);
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

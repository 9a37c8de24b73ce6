#include "samples/bucket_cache.h"

#include <iterator>
#include <utility>

namespace lamina {
namespace {

/// Buckets forgotten whose memory is kept for the next ones.
constexpr std::size_t kSpares = 3;

std::size_t bytes_of(const LocalSamples& s) {
  constexpr std::size_t kAnnotation = 2 * sizeof(float) + 1;
  const std::size_t optional = (s.radius.empty() ? 0 : 1) + (s.quality.empty() ? 0 : 1) + s.attributes.size();
  return s.size() * ((6 + optional) * sizeof(float) + kAnnotation);
}

}  // namespace

BucketCache::BucketCache(const SlabStore& store, const Lattice& lattice, std::size_t budget_bytes)
    : store_(store), lattice_(lattice), budget_(budget_bytes) {}

BucketCache::~BucketCache() {
  tasks_.wait();
}

std::shared_ptr<ActiveBucket> BucketCache::spare() {
  if (spares_.empty()) return std::make_shared<ActiveBucket>();
  auto bucket = std::move(spares_.back());
  spares_.pop_back();
  return bucket;
}

void BucketCache::load(std::size_t bucket, ActiveBucket& out) {
  out.support.clear();
  store_.read(bucket, out.samples);
  sort_by_block(out.samples, lattice_, scratch_.local());
}

void BucketCache::prefetch(std::size_t bucket) {
  if (store_.count(bucket) == 0 || here_.contains(bucket) || incoming_.contains(bucket)) return;
  ++reads_;
  Incoming& incoming = incoming_[bucket];
  incoming.loaded = spare();
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
    loaded = spare();  // an empty bucket is never read
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
  recycle(std::move(found->second));
  here_.erase(found);
}

void BucketCache::recycle(std::shared_ptr<ActiveBucket> bucket) {
  if (bucket.use_count() == 1 && spares_.size() < kSpares) spares_.push_back(std::move(bucket));
}

}  // namespace lamina

#include "feed/sample_feed.h"

#include <algorithm>
#include <cmath>

namespace lamina {
namespace {

std::size_t bytes_of(const ActiveBucket& b) {
  const LocalSamples& s = b.samples;
  return s.size() * (9 * sizeof(float) + 1 + s.attributes.size() * sizeof(float));
}

/// Coarsest level whose cell is at most `size`.
std::uint8_t level_for(double size, const Lattice& lattice) {
  int level = 0;
  while (level + 1 < lattice.levels && lattice.cell_size(level + 1) <= size) ++level;
  return static_cast<std::uint8_t>(level);
}

}  // namespace

SampleFeed::SampleFeed(const SlabStore& store, const Lattice& lattice, const FeedSettings& settings,
                       const RadiiSettings& radii, bool given_radii)
    : store_(store), lattice_(lattice), settings_(settings) {
  if (!given_radii) estimator_ = std::make_unique<RadiusEstimator>(radii);
  // A radius that asks for cells larger than the coarsest level has gives no more than that level can use.
  const double coarsest = 2.0 * lattice.cell_size(lattice.levels - 1) / settings.cell_ratio;
  radius_limit_ = static_cast<float>(settings.cell_follows_support ? coarsest / settings.blend : coarsest);
  support_limit_ = radius_limit_ * settings.blend;
}

void SampleFeed::prepare(std::int64_t z_limit, const OnReady& on_ready) {
  while (ready_ < store_.buckets()) {
    // Buckets are ascending and disjoint in z: the next one decides.
    std::size_t next = ready_;
    while (next < store_.buckets() && store_.count(next) == 0) ++next;
    if (next == store_.buckets() || store_.z_lower(next) >= z_limit) return;
    std::vector<float> radii;
    if (estimator_ == nullptr) {
      LocalSamples samples;
      store_.read(ready_, samples);
      ++counts_.bucket_reads;
      learn(std::move(samples.radius), on_ready);
      continue;
    }
    if (estimator_->pop(radii)) {
      learn(std::move(radii), on_ready);
      continue;
    }
    LocalSamples samples;
    store_.read(pushed_, samples);
    ++counts_.bucket_reads;
    estimator_->push(samples);
    if (++pushed_ == store_.buckets()) estimator_->finish();
  }
}

void SampleFeed::learn(std::vector<float> radii, const OnReady& on_ready) {
  Known& known = known_[ready_];
  for (float& r : radii) {
    ++counts_.samples;
    if (estimator_ != nullptr) r *= settings_.radius_scale;
    if (settings_.max_radius > 0 && r > settings_.max_radius) {
      ++counts_.undersampled;
      r = 0;
    } else if (r > radius_limit_) {
      ++counts_.clamped;
      r = radius_limit_;
    }
    known.max_support = std::max(known.max_support, r * settings_.blend);
  }
  known.radius = std::move(radii);
  if (store_.count(ready_) > 0) on_ready(*fetch(ready_));
  ++ready_;
}

void SampleFeed::annotate(std::size_t bucket, ActiveBucket& out) const {
  const Known& known = known_.at(bucket);
  const std::size_t n = out.samples.size();
  out.support.resize(n);
  out.weight.resize(n);
  out.level.resize(n);
  out.max_support = known.max_support;
  const auto finest = static_cast<float>(lattice_.cell);
  const double ratio = settings_.cell_ratio * (settings_.cell_follows_support ? settings_.blend : 1.0F);
  for (std::size_t i = 0; i < n; ++i) {
    const float r = known.radius[i];
    out.support[i] = r * settings_.blend;
    // q_i is proportional to the sampling density 1 / r^2 (METHOD 3.1), scaled by the finest cell to stay near one.
    const float q = r > 0 ? finest / r : 0.0F;
    out.weight[i] = q * q * (out.samples.quality.empty() ? 1.0F : out.samples.quality[i]);
    out.level[i] = settings_.fixed_cell ? std::uint8_t{0} : level_for(static_cast<double>(r) * ratio, lattice_);
  }
}

std::shared_ptr<const ActiveBucket> SampleFeed::fetch(std::size_t bucket) {
  const auto hit = std::find_if(cache_.begin(), cache_.end(), [&](const auto& e) { return e.first == bucket; });
  if (hit != cache_.end()) {
    cache_.splice(cache_.begin(), cache_, hit);
    return cache_.front().second;
  }
  auto loaded = std::make_shared<ActiveBucket>();
  store_.read(bucket, loaded->samples);
  ++counts_.bucket_reads;
  annotate(bucket, *loaded);
  cached_bytes_ += bytes_of(*loaded);
  cache_.emplace_front(bucket, loaded);
  while (cached_bytes_ > settings_.cache_bytes && cache_.size() > 1) {
    cached_bytes_ -= bytes_of(*cache_.back().second);
    cache_.pop_back();
  }
  return loaded;
}

std::vector<std::vector<std::size_t>> SampleFeed::batches(std::int64_t lo, std::int64_t hi, float margin) const {
  std::vector<std::vector<std::size_t>> out;
  std::uint64_t held = 0;
  for (std::size_t b = first_; b < ready_; ++b) {
    if (store_.count(b) == 0) continue;
    const double reach = std::ceil(static_cast<double>(known_.at(b).max_support + margin));
    if (store_.z_upper(b) + reach < static_cast<double>(lo) || store_.z_lower(b) - reach >= static_cast<double>(hi))
      continue;
    if (out.empty() || held + store_.count(b) > settings_.batch_samples) {
      out.emplace_back();
      held = 0;
    }
    out.back().push_back(b);
    held += store_.count(b);
  }
  return out;
}

Batch SampleFeed::load(const std::vector<std::size_t>& batch) {
  Batch out;
  out.reserve(batch.size());
  for (const std::size_t b : batch) out.push_back(fetch(b));
  return out;
}

void SampleFeed::release(std::int64_t z) {
  while (first_ < ready_ && (store_.count(first_) == 0 || store_.z_upper(first_) < z)) {
    released_ += store_.count(first_);
    known_.erase(first_);
    const auto hit = std::find_if(cache_.begin(), cache_.end(), [&](const auto& e) { return e.first == first_; });
    if (hit != cache_.end()) {
      cached_bytes_ -= bytes_of(*hit->second);
      cache_.erase(hit);
    }
    ++first_;
  }
}

}  // namespace lamina

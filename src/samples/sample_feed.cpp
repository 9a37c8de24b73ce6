#include "samples/sample_feed.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "base/resize_anew.h"
#include "samples/thin_cells.h"

namespace lamina {
namespace {

/// Buckets on their way from the store while the stages work.
constexpr int kReadAhead = 2;
/// Buckets beyond them that the system is told of.
constexpr int kAnnounceAhead = 6;

/// Side of the coarsest counting cells, steps.
std::int64_t counting_height(const RadiiSettings& radii) {
  return std::int64_t{radii.finest_cell} << (radii.levels - 1);
}

std::int64_t cell_of(std::int64_t z, std::int64_t height) {
  return z / height - (z % height < 0 ? 1 : 0);
}

/// The first bucket that a feed beginning at z reads; `counting`: side of the coarsest counting cells, 0 where there
/// are none; `filter_halo`: of the filter of normals.
std::size_t first_bucket(const SlabStore& store, std::int64_t z, std::int64_t counting, double filter_halo) {
  const auto first_reaching = [&](std::int64_t from) {
    std::size_t bucket = 0;
    while (bucket < store.buckets() && (store.count(bucket) == 0 || store.z_upper(bucket) < from)) ++bucket;
    return bucket;
  };
  std::size_t first = first_reaching(z);
  if (filter_halo > 0 && first < store.buckets())
    first = first_reaching(store.z_lower(first) - static_cast<std::int64_t>(filter_halo));
  if (counting == 0 || first == store.buckets()) return first;
  // A radius depends on the counting cells above and below the sample's own.
  return first_reaching((cell_of(store.z_lower(first), counting) - 1) * counting);
}

/// H as the samples' arithmetic has it.
float blend_of(const FeedSettings& settings) {
  return static_cast<float>(settings.blend);
}

/// A radius that asks for cells larger than the coarsest level has gives no more than that level can use.
float radius_limit(const FeedSettings& settings, const Lattice& lattice) {
  const double coarsest = 2.0 * lattice.cell_size(lattice.levels - 1) / settings.cell_ratio();
  return static_cast<float>(settings.cell_follows_support() ? coarsest / blend_of(settings) : coarsest);
}

/// Coarsest level whose cell is at most `size`.
std::uint8_t level_for(double size, const Lattice& lattice) {
  int level = 0;
  while (level + 1 < lattice.levels && lattice.cell_size(level + 1) <= size) ++level;
  return static_cast<std::uint8_t>(level);
}

}  // namespace

float support_limit(const FeedSettings& settings, const Lattice& lattice) {
  return radius_limit(settings, lattice) * blend_of(settings);
}

SampleFeed::SampleFeed(SlabStore& store, const Lattice& lattice, const FeedSettings& settings,
                       const RadiiSettings& radii, bool given_radii)
    : store_(store),
      lattice_(lattice),
      settings_(settings),
      counting_height_(counting_height(radii)),
      cache_(store, lattice, settings.cache_bytes) {
  if (!given_radii) estimator_ = std::make_unique<RadiusEstimator>(radii);
  radius_limit_ = radius_limit(settings, lattice);
  support_limit_ = lamina::support_limit(settings, lattice);
}

FeedCounts SampleFeed::counts() const {
  FeedCounts counts = counts_;
  counts.bucket_reads = cache_.reads();
  return counts;
}

std::size_t SampleFeed::next_filled(std::size_t bucket) const {
  while (bucket < store_.buckets() && store_.count(bucket) == 0) ++bucket;
  return bucket;
}

void SampleFeed::begin_at(std::int64_t z) {
  const std::size_t first =
      first_bucket(store_, z, estimator_ == nullptr ? 0 : counting_height_, filter_ == nullptr ? 0 : filter_->halo());
  pushed_ = announced_ = measured_ = ready_ = first_ = first;
}

BucketSpan buckets_read(const SlabStore& store, const RadiiSettings& radii, bool given_radii,
                        std::optional<std::int64_t> from, std::int64_t to, double filter_halo) {
  const std::int64_t height = given_radii ? 0 : counting_height(radii);
  BucketSpan span{from ? first_bucket(store, *from, height, filter_halo) : 0, 0};
  std::int64_t known = to;  // below this all samples are asked for
  span.end = span.begin;
  const auto ask_below = [&](std::int64_t limit) {
    while (span.end < store.buckets() && (store.count(span.end) == 0 || store.z_lower(span.end) < limit)) {
      if (store.count(span.end) > 0) known = std::max(known, std::int64_t{store.z_upper(span.end)} + 1);
      ++span.end;
    }
  };
  ask_below(to);
  if (filter_halo > 0) ask_below(known + static_cast<std::int64_t>(filter_halo) + 1);
  if (given_radii) return span;
  // The last one's radii are final when a sample lies beyond the counting cells above its own.
  const std::int64_t beyond = (cell_of(known - 1, height) + 2) * height;
  while (span.end < store.buckets() && store.z_upper(span.end) < beyond) ++span.end;
  span.end = std::min(span.end + 1, store.buckets());
  return span;
}

void SampleFeed::prepare(std::int64_t z_limit, const OnReady& on_ready) {
  std::size_t& front = estimator_ == nullptr ? measured_ : pushed_;  // next to be read for the first time
  const auto read_ahead = [&] {
    std::size_t next = front;
    for (int i = 0; i < kReadAhead && (next = next_filled(next)) < store_.buckets(); ++i) cache_.prefetch(next++);
    announced_ = std::max(announced_, next);
    for (int i = 0; i < kAnnounceAhead && (next = next_filled(next)) < store_.buckets(); ++i, ++next) {
      if (next < announced_) continue;
      store_.will_read(next);
      announced_ = next + 1;
    }
  };
  while (ready_ < store_.buckets()) {
    // Buckets are ascending and disjoint in z: the next one decides.
    const std::size_t next = next_filled(ready_);
    if (next == store_.buckets() || store_.z_lower(next) >= z_limit) break;
    if (ready_ < measured_ && is_surrounded(ready_)) {
      make_ready(on_ready);
      continue;
    }
    std::vector<float> radii;
    if (estimator_ == nullptr) {
      read_ahead();
      if (store_.count(measured_) > 0) radii = cache_.get(measured_)->samples.radius;
      learn(std::move(radii));
      continue;
    }
    if (estimator_->pop(radii)) {
      learn(std::move(radii));
      continue;
    }
    read_ahead();
    if (store_.count(pushed_) > 0) {
      estimator_->push(cache_.get(pushed_)->samples);
    } else {
      estimator_->push({});
    }
    if (++pushed_ == store_.buckets()) estimator_->finish();
  }
  read_ahead();
}

bool SampleFeed::is_surrounded(std::size_t bucket) const {
  if (filter_ == nullptr || store_.count(bucket) == 0 || measured_ == store_.buckets()) return true;
  const std::size_t next = next_filled(measured_);
  return next == store_.buckets() ||
         static_cast<double>(store_.z_lower(next)) > static_cast<double>(store_.z_upper(bucket)) + filter_->halo();
}

void SampleFeed::make_ready(const OnReady& on_ready) {
  if (store_.count(ready_) > 0) {
    if (filter_ != nullptr) {
      known_[ready_].normals = filter_->find(ready_);
      filter_->forget_below(static_cast<std::int64_t>(store_.z_lower(ready_)) -
                            static_cast<std::int64_t>(filter_->halo()) - 1);
    }
    on_ready(*fetch(ready_));
  }
  ++ready_;
}

void SampleFeed::learn(std::vector<float> radii) {
  Known& known = known_[measured_];
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
    known.max_support = std::max(known.max_support, r * blend_of(settings_));
  }
  if (filter_ != nullptr && !radii.empty()) filter_->add(measured_, cache_.get(measured_)->samples, radii);
  known.radius = std::move(radii);
  ++measured_;
}

void SampleFeed::annotate(std::size_t bucket, ActiveBucket& out) const {
  const Known& known = known_.at(bucket);
  const std::size_t n = out.samples.size();
  resize_anew(out.support, n);
  resize_anew(out.weight, n);
  resize_anew(out.level, n);
  out.max_support = known.max_support;
  const auto finest = static_cast<float>(lattice_.cell);
  const float blend = blend_of(settings_);
  const double ratio = settings_.cell_ratio() * (settings_.cell_follows_support() ? blend : 1.0F);
  const bool has_quality = !out.samples.quality.empty(), fixed = settings_.fixed_cell();
  if (!known.normals.x.empty()) {
    out.samples.nx = known.normals.x;
    out.samples.ny = known.normals.y;
    out.samples.nz = known.normals.z;
  }
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n, 8192), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      const float r = known.radius[i];
      out.support[i] = r * blend;
      // q_i is proportional to the sampling density 1 / r^2 (Cuccuru et al. 2009, section 3.1), scaled by the finest
      // cell to stay near one.
      const float q = r > 0 ? finest / r : 0.0F;
      out.weight[i] = q * q * (has_quality ? out.samples.quality[i] : 1.0F);
      out.level[i] = fixed ? std::uint8_t{0} : level_for(static_cast<double>(r) * ratio, lattice_);
    }
  });
  if (settings_.thin_cells && !fixed) refine_thin(lattice_, out.samples, known.radius, out.level);
}

std::shared_ptr<const ActiveBucket> SampleFeed::fetch(std::size_t bucket) {
  auto active = cache_.get(bucket);
  if (active->support.size() != active->samples.size()) annotate(bucket, *active);
  return active;
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
  for (const std::size_t b : batch) cache_.prefetch(b);
  for (const std::size_t b : batch) out.push_back(fetch(b));
  return out;
}

void SampleFeed::release(std::int64_t z) {
  while (first_ < ready_ && (store_.count(first_) == 0 || store_.z_upper(first_) < z)) {
    released_ += store_.count(first_);
    known_.erase(first_);
    cache_.drop(first_);
    ++first_;
  }
  store_.release_before(first_);
}

}  // namespace lamina

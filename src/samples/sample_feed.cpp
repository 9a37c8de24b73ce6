#include "samples/sample_feed.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/vectors.h"

namespace lamina {
namespace {

std::int64_t cell_of(std::int64_t z, std::int64_t height) {
  return z / height - (z % height < 0 ? 1 : 0);
}

/// The first bucket that a feed beginning at z reads.
std::size_t first_bucket(const SlabStore& store, std::int64_t z, const FeedHalo& halo) {
  const auto first_reaching = [&](std::int64_t from) {
    std::size_t bucket = 0;
    while (bucket < store.buckets() && (store.count(bucket) == 0 || store.z_upper(bucket) < from)) ++bucket;
    return bucket;
  };
  std::size_t first = first_reaching(z);
  // What the first one's samples depend on, last things first: levels on normals, these on radii.
  const auto widen_to_cell_below = [&](std::int64_t cell) {
    if (cell > 0 && first < store.buckets()) first = first_reaching((cell_of(store.z_lower(first), cell) - 1) * cell);
  };
  widen_to_cell_below(halo.sheet_cell);
  if (halo.normal_filter > 0 && first < store.buckets())
    first = first_reaching(store.z_lower(first) - static_cast<std::int64_t>(halo.normal_filter));
  widen_to_cell_below(halo.counting_cell);
  return first;
}

/// H as the samples' arithmetic has it.
float widest_of(const FeedSettings& settings) {
  return static_cast<float>(settings.widest());
}

/// A radius that asks for cells larger than the coarsest level has gives no more than that level can use.
float radius_limit(const FeedSettings& settings, const Lattice& lattice) {
  const double coarsest = 2.0 * lattice.cell_size(lattice.levels - 1) / settings.cell_ratio();
  return static_cast<float>(settings.cell_follows_support() ? coarsest / widest_of(settings) : coarsest);
}

/// Coarsest level whose cell is at most `size`.
std::uint8_t level_for(double size, const Lattice& lattice) {
  int level = 0;
  while (level + 1 < lattice.levels && lattice.cell_size(level + 1) <= size) ++level;
  return static_cast<std::uint8_t>(level);
}

}  // namespace

float support_limit(const FeedSettings& settings, const Lattice& lattice) {
  return radius_limit(settings, lattice) * widest_of(settings);
}

FeedHalo feed_halo(const FeedSettings& settings, const Lattice& lattice, const RadiiSettings& radii, bool given_radii,
                   double filter_halo) {
  FeedHalo halo;
  if (!given_radii) halo.counting_cell = std::int64_t{radii.finest_cell} << (radii.levels - 1);
  halo.normal_filter = filter_halo;
  if (settings.refines_sheets()) halo.sheet_cell = lattice.cell_size(lattice.levels - 1);
  return halo;
}

SampleFeed::SampleFeed(SlabStore& store, const Lattice& lattice, const FeedSettings& settings,
                       const RadiiSettings& radii, bool given_radii)
    : store_(store),
      lattice_(lattice),
      settings_(settings),
      radii_settings_(radii),
      cache_(store, lattice, settings.cache_bytes) {
  if (!given_radii) measuring_ = std::make_unique<RadiiAhead>(store, lattice, radii);
  if (settings.refines_sheets()) sheets_ = std::make_unique<SheetRefinement>(lattice);
  radius_limit_ = radius_limit(settings, lattice);
  support_limit_ = lamina::support_limit(settings, lattice);
}

FeedCounts SampleFeed::counts() const {
  FeedCounts counts = counts_;
  counts.bucket_reads += cache_.reads();
  return counts;
}

void SampleFeed::begin_at(std::int64_t z) {
  const FeedHalo halo =
      feed_halo(settings_, lattice_, radii_settings_, measuring_ == nullptr, filter_ == nullptr ? 0 : filter_->halo());
  measured_ = oriented_ = ready_ = first_ = first_bucket(store_, z, halo);
  if (measuring_) measuring_->begin_at(first_);
}

BucketSpan buckets_read(const SlabStore& store, const FeedHalo& halo, std::optional<std::int64_t> from,
                        std::int64_t to) {
  BucketSpan span{from ? first_bucket(store, *from, halo) : 0, 0};
  std::int64_t known = to;  // below this all samples are asked for
  span.end = span.begin;
  const auto ask_below = [&](std::int64_t limit) {
    while (span.end < store.buckets() && (store.count(span.end) == 0 || store.z_lower(span.end) < limit)) {
      if (store.count(span.end) > 0) known = std::max(known, std::int64_t{store.z_upper(span.end)} + 1);
      ++span.end;
    }
  };
  const auto above_next_cell = [&](std::int64_t cell) { return (cell_of(known - 1, cell) + 2) * cell; };
  ask_below(to);
  if (halo.sheet_cell > 0) ask_below(above_next_cell(halo.sheet_cell));
  if (halo.normal_filter > 0) ask_below(known + static_cast<std::int64_t>(halo.normal_filter) + 1);
  if (halo.counting_cell == 0) return span;
  // The last one's radii are final when a sample lies beyond the counting cells above its own.
  const std::int64_t beyond = above_next_cell(halo.counting_cell);
  while (span.end < store.buckets() && store.z_upper(span.end) < beyond) ++span.end;
  span.end = std::min(span.end + 1, store.buckets());
  return span;
}

bool SampleFeed::begins_below(std::size_t bucket, std::int64_t z) const {
  return bucket < store_.buckets() && store_.z_lower(bucket) < z;
}

void SampleFeed::prepare(std::int64_t z_limit, const OnReady& on_ready) {
  // Buckets are ascending and disjoint in z: the next one decides.
  while (begins_below(store_.next_filled(ready_), z_limit)) {
    if (const auto buckets = settle_below(z_limit); !buckets.empty()) {
      hand_over(buckets, on_ready);
    } else if (!orient_next()) {
      learn_radii();
    }
  }
}

void SampleFeed::look_ahead(std::int64_t next, std::int64_t after_that) {
  // A bucket waits for those around it: no more than buckets_read() says.
  const std::int64_t reach = (filter_ == nullptr ? 0 : static_cast<std::int64_t>(filter_->halo())) +
                             (sheets_ == nullptr ? 0 : lattice_.cell_size(lattice_.levels - 1));
  std::size_t known = store_.buckets();
  if (measuring_) {
    take_measured();
    measuring_->measure_below(after_that + reach);
    known = measured_ + radii_.size();
  }
  std::size_t b = store_.next_filled(ready_);
  for (; b < known && begins_below(b, next + reach); b = store_.next_filled(b + 1)) cache_.prefetch(b);
  if (measuring_) return;
  for (announced_ = std::max(announced_, b); begins_below(announced_, after_that + reach);
       announced_ = store_.next_filled(announced_ + 1))
    store_.will_read(announced_);
}

void SampleFeed::take_measured() {
  for (RadiiAhead::Measured& bucket : measuring_->take()) {
    if (!bucket.radii.empty()) {
      ++counts_.bucket_reads;
      cache_.know_order(measured_ + radii_.size(), std::move(bucket.order));
    }
    radii_.push_back(std::move(bucket.radii));
  }
}

void SampleFeed::learn_radii() {
  std::vector<float> radii;
  if (measuring_ == nullptr) {
    if (store_.count(measured_) > 0) radii = cache_.get(measured_)->samples.radius;
  } else {
    if (radii_.empty()) {
      measuring_->measure_below(first_from(measured_) + 1);
      take_measured();
    }
    radii = std::move(radii_.front());
    radii_.pop_front();
  }
  Known& known = known_[measured_];
  for (float& r : radii) {
    ++counts_.samples;
    if (measuring_ != nullptr) r *= settings_.radius_scale;
    if (settings_.max_radius > 0 && r > settings_.max_radius) {
      ++counts_.undersampled;
      r = 0;
    } else if (r > radius_limit_) {
      ++counts_.clamped;
      r = radius_limit_;
    }
    known.max_support = std::max(known.max_support, r * widest_of(settings_));
  }
  if (filter_ != nullptr && !radii.empty()) filter_->add(measured_, cache_.get(measured_)->samples, radii);
  known.radius = std::move(radii);
  ++measured_;
}

std::int64_t SampleFeed::first_from(std::size_t bucket) const {
  const std::size_t next = store_.next_filled(bucket);
  return next == store_.buckets() ? std::numeric_limits<std::int64_t>::max() : std::int64_t{store_.z_lower(next)};
}

bool SampleFeed::orient_next() {
  if (oriented_ == measured_) return false;
  if (store_.count(oriented_) > 0) {
    if (filter_ != nullptr) {
      const double halo = filter_->halo();
      if (static_cast<double>(first_from(measured_)) <= static_cast<double>(store_.z_upper(oriented_)) + halo)
        return false;
      known_[oriented_].normals = filter_->find(oriented_);
      filter_->forget_below(std::int64_t{store_.z_lower(oriented_)} - static_cast<std::int64_t>(halo) - 1);
    }
    if (sheets_ != nullptr) {
      const auto bucket = fetch(oriented_);
      sheets_->push(bucket->samples, bucket->level, bucket->support);
    }
  }
  ++oriented_;
  return true;
}

std::vector<std::size_t> SampleFeed::settle_below(std::int64_t z_limit) {
  std::vector<std::size_t> settled;
  std::uint64_t samples = 0;
  for (; ready_ < oriented_ && samples < kSamplesTogether; ++ready_) {
    if (store_.count(ready_) == 0) continue;
    if (store_.z_lower(ready_) >= z_limit) break;
    if (sheets_ != nullptr && !sheets_->pop(first_from(oriented_), known_[ready_].finer)) break;
    settled.push_back(ready_);
    samples += store_.count(ready_);
  }
  return settled;
}

void SampleFeed::hand_over(const std::vector<std::size_t>& buckets, const OnReady& on_ready) {
  for (const std::size_t b : buckets) cache_.prefetch(b);
  std::vector<std::shared_ptr<ActiveBucket>> here;
  here.reserve(buckets.size());
  for (const std::size_t b : buckets) here.push_back(cache_.get(b));
  tbb::parallel_for(std::size_t{0}, buckets.size(), [&](std::size_t k) { annotate(buckets[k], *here[k]); });
  on_ready({here.begin(), here.end()});
}

void SampleFeed::annotate(std::size_t bucket, ActiveBucket& out) const {
  const Known& known = known_.at(bucket);
  const std::size_t n = out.samples.size();
  resize_anew(out.support, n);
  resize_anew(out.weight, n);
  resize_anew(out.band, n);
  resize_anew(out.level, n);
  out.max_support = known.max_support;
  const auto finest = static_cast<float>(lattice_.cell);
  const auto same = static_cast<float>(settings_.blend);
  const bool follows = settings_.cell_follows_support();
  const double cell_ratio = settings_.cell_ratio();
  const bool has_quality = !out.samples.quality.empty(), fixed = settings_.fixed_cell();
  if (!known.normals.x.empty()) {
    out.samples.nx = known.normals.x;
    out.samples.ny = known.normals.y;
    out.samples.nz = known.normals.z;
  }
  out.residual = known.normals.residual;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n, kSampleGrain), [&](const auto& range) {
    SupportField::Cursor* const local = settings_.support ? &settings_.support->cursor() : nullptr;
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      const float r = known.radius[i];
      const float blend = local ? local->at(out.samples.x[i], out.samples.y[i], out.samples.z[i]) : same;
      out.support[i] = r * blend;
      // q_i is proportional to the sampling density 1 / r^2 (Cuccuru et al. 2009, section 3.1), scaled by the finest
      // cell to stay near one.
      const float q = r > 0 ? finest / r : 0.0F;
      out.weight[i] = q * q * (has_quality ? out.samples.quality[i] : 1.0F);
      out.level[i] = fixed ? std::uint8_t{0}
                           : level_for(static_cast<double>(r) * (cell_ratio * (follows ? blend : 1.0F)), lattice_);
      if (!known.finer.empty() && known.finer[i] != 0) --out.level[i];
      out.band[i] = std::max(settings_.band_cells * static_cast<float>(lattice_.cell_size(out.level[i])),
                             settings_.band_radii * r);
    }
  });
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

#include "normals/sample_window.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "store/ingest.h"

namespace lamina::normals {
namespace {

/// Calls each(column of from, column of to) for all columns.
template <class Each>
void for_columns(const WindowSamples& from, WindowSamples& to, const Each& each) {
  each(from.x, to.x);
  each(from.y, to.y);
  each(from.z, to.z);
  each(from.nx, to.nx);
  each(from.ny, to.ny);
  each(from.nz, to.nz);
  each(from.row, to.row);
  each(from.node, to.node);
  each(from.given, to.given);
  each(from.lift, to.lift);
}

void append_all(const WindowSamples& from, WindowSamples& to) {
  for_columns(from, to,
              [](const auto& source, auto& target) { target.insert(target.end(), source.begin(), source.end()); });
}

/// Of the samples with z in low..high.
std::vector<std::uint32_t> places_between(const WindowSamples& samples, std::int64_t low, std::int64_t high) {
  std::vector<std::uint32_t> places;
  for (std::uint32_t i = 0; i < samples.size(); ++i) {
    if (samples.z[i] >= low && samples.z[i] <= high) places.push_back(i);
  }
  return places;
}

}  // namespace

void WindowSamples::append(const WindowSamples& from, std::span<const std::uint32_t> which) {
  for_columns(from, *this, [which](const auto& source, auto& target) {
    const std::size_t before = target.size();
    target.resize(before + which.size());
    for (std::size_t i = 0; i < which.size(); ++i) target[before + i] = source[which[i]];
  });
}

void WindowSamples::gather(const WindowSamples& from, std::span<const std::uint32_t> order) {
  for_columns(from, *this, [order](const auto& source, auto& target) {
    target.resize(order.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, order.size(), std::size_t{1} << 14), [&](const auto& range) {
      for (std::size_t i = range.begin(); i < range.end(); ++i) target[i] = source[order[i]];
    });
  });
}

Slab slab_from(const SlabStore& store, const WindowSettings& settings, std::size_t first) {
  Slab slab{first, first, std::numeric_limits<std::int32_t>::max(), std::numeric_limits<std::int32_t>::min(), 0};
  while (slab.end < store.buckets() &&
         (slab.samples < settings.least_samples || slab.high - slab.low < settings.least_height)) {
    if (store.count(slab.end) > 0) {
      slab.low = std::min<std::int64_t>(slab.low, store.z_lower(slab.end));
      slab.high = std::max<std::int64_t>(slab.high, store.z_upper(slab.end));
    }
    slab.samples += store.count(slab.end++);
  }
  return slab;
}

WindowCounts largest_window(const SlabStore& store, const WindowSettings& settings) {
  WindowCounts most;
  for (Slab slab = slab_from(store, settings, 0); slab.low <= slab.high; slab = slab_from(store, settings, slab.end)) {
    std::uint64_t window = 0;
    for (std::size_t b = 0; b < store.buckets(); ++b) {
      if (store.count(b) > 0 && store.z_upper(b) >= slab.low - settings.halo &&
          store.z_lower(b) <= slab.high + settings.halo)
        window += store.count(b);
    }
    most.window = std::max(most.window, window);
    most.slab = std::max(most.slab, slab.samples);
  }
  return most;
}

SampleWindow::SampleWindow(const SlabStore& store, const WindowSettings& settings)
    : store_(store), settings_(settings) {}

void SampleWindow::load(std::size_t bucket) {
  LocalSamples local;
  store_.read(bucket, local);
  WindowSamples& s = ahead_.emplace_back();
  const std::size_t n = local.size();
  s.row.resize(n);
  s.given.resize(n);
  s.lift.resize(n);
  s.node.assign(n, kNoNode);
  for (std::size_t i = 0; i < n; ++i) {
    s.row[i] = row_of(local, i);
    s.given[i] = has_given_normal(local, i) ? 1 : 0;
    if (s.given[i] == 0) local.nx[i] = local.ny[i] = local.nz[i] = 0;
  }
  s.x = std::move(local.x);
  s.y = std::move(local.y);
  s.z = std::move(local.z);
  s.nx = std::move(local.nx);
  s.ny = std::move(local.ny);
  s.nz = std::move(local.nz);
}

/// Drops samples below the halo of the slab.
void SampleWindow::keep_what_is_near() {
  before_ = {};
  before_.append(samples_, places_between(samples_, slab_.low - settings_.halo, slab_.low - 1));
}

bool SampleWindow::advance() {
  slab_ = slab_from(store_, settings_, slab_.end);
  if (slab_.high < slab_.low) return false;
  keep_what_is_near();
  for (; loaded_ < store_.buckets(); ++loaded_) {
    const bool near =
        loaded_ < slab_.end || store_.count(loaded_) == 0 || store_.z_lower(loaded_) <= slab_.high + settings_.halo;
    if (!near) break;
    load(loaded_);
  }
  WindowSamples all = std::move(before_);
  const std::size_t begin = all.size();
  for (std::size_t b = slab_.first; b < slab_.end; ++b) {
    append_all(ahead_.front(), all);
    ahead_.pop_front();
  }
  const std::size_t end = all.size();
  for (const WindowSamples& bucket : ahead_) {
    all.append(bucket, places_between(bucket, std::numeric_limits<std::int32_t>::min(), slab_.high + settings_.halo));
  }
  done_ += end - begin;
  tree_ = std::make_unique<SampleTree>(all.x, all.y, all.z);
  samples_.gather(all, tree_->order());
  core_.clear();
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const std::uint32_t number = tree_->order()[i];
    if (number >= begin && number < end) core_.push_back(static_cast<std::uint32_t>(i));
  }
  return true;
}

}  // namespace lamina::normals

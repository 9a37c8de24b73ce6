#include "normals/sample_window.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "store/numbered_rows.h"

namespace lamina::normals {
namespace {

void append_all(const WindowSamples& from, WindowSamples& to) {
  const auto add = [](const auto& source, auto& target) { target.insert(target.end(), source.begin(), source.end()); };
  add(from.x, to.x);
  add(from.y, to.y);
  add(from.z, to.z);
  add(from.nx, to.nx);
  add(from.ny, to.ny);
  add(from.nz, to.nz);
  add(from.row, to.row);
  add(from.node, to.node);
  add(from.given, to.given);
}

}  // namespace

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
      if (store.count(b) > 0 && store.z_upper(b) >= slab.low - settings.reach &&
          store.z_lower(b) <= slab.high + settings.reach)
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

/// Drops samples below the slab's reach.
void SampleWindow::keep_what_is_near() {
  WindowSamples kept;
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    if (samples_.z[i] >= slab_.low - settings_.reach && samples_.z[i] < slab_.low) kept.append(samples_, i);
  }
  before_ = std::move(kept);
}

bool SampleWindow::advance() {
  slab_ = slab_from(store_, settings_, slab_.end);
  if (slab_.high < slab_.low) return false;
  keep_what_is_near();
  for (; loaded_ < store_.buckets(); ++loaded_) {
    const bool near =
        loaded_ < slab_.end || store_.count(loaded_) == 0 || store_.z_lower(loaded_) <= slab_.high + settings_.reach;
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
    for (std::size_t i = 0; i < bucket.size(); ++i) {
      if (bucket.z[i] <= slab_.high + settings_.reach) all.append(bucket, i);
    }
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

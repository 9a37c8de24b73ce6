#include "normals/sample_window.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "normals/numbered_points.h"

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

void SampleWindow::choose_slab() {
  std::uint64_t samples = 0;
  low_ = std::numeric_limits<std::int32_t>::max();
  high_ = std::numeric_limits<std::int32_t>::min();
  while (next_ < store_.buckets() && (samples < settings_.least_samples || high_ - low_ < settings_.least_height)) {
    if (store_.count(next_) > 0) {
      low_ = std::min<std::int64_t>(low_, store_.z_lower(next_));
      high_ = std::max<std::int64_t>(high_, store_.z_upper(next_));
    }
    samples += store_.count(next_++);
  }
}

/// Drops samples below the slab's reach.
void SampleWindow::keep_what_is_near() {
  WindowSamples kept;
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    if (samples_.z[i] >= low_ - settings_.reach && samples_.z[i] < low_) kept.append(samples_, i);
  }
  before_ = std::move(kept);
}

bool SampleWindow::advance() {
  const std::size_t first = next_;
  choose_slab();
  if (first == next_ || high_ < low_) return false;
  keep_what_is_near();
  for (; loaded_ < store_.buckets(); ++loaded_) {
    const bool near =
        loaded_ < next_ || store_.count(loaded_) == 0 || store_.z_lower(loaded_) <= high_ + settings_.reach;
    if (!near) break;
    load(loaded_);
  }
  WindowSamples all = std::move(before_);
  const std::size_t begin = all.size();
  for (std::size_t b = first; b < next_; ++b) {
    append_all(ahead_.front(), all);
    ahead_.pop_front();
  }
  const std::size_t end = all.size();
  for (const WindowSamples& bucket : ahead_) {
    for (std::size_t i = 0; i < bucket.size(); ++i) {
      if (bucket.z[i] <= high_ + settings_.reach) all.append(bucket, i);
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

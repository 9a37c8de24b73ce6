#include "samples/neighbourhoods.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "base/resize_anew.h"

namespace lamina {
namespace {

constexpr std::uint64_t kStraySlab = 1u << 17;  ///< samples tested together, at least

}  // namespace

bool Neighbourhoods::advance() {
  first_ = end_;
  low_ = std::numeric_limits<std::int64_t>::max();
  high_ = std::numeric_limits<std::int64_t>::min();
  std::uint64_t samples = 0;
  // Tall enough that few samples are looked at for two slabs.
  for (; end_ < store_.buckets() && (samples < kStraySlab || high_ - low_ < 2 * halo_); ++end_) {
    if (store_.count(end_) == 0) continue;
    samples += store_.count(end_);
    low_ = std::min<std::int64_t>(low_, store_.z_lower(end_));
    high_ = std::max<std::int64_t>(high_, store_.z_upper(end_));
  }
  if (samples == 0) return false;
  gather();
  return true;
}

void Neighbourhoods::gather() {
  std::size_t from = first_;
  while (from > 0 && (store_.count(from - 1) == 0 || store_.z_upper(from - 1) >= low_ - halo_)) --from;
  while (!held_.empty() && held_.begin()->first < from) spare_.push_back(held_.extract(held_.begin()));
  for (auto* axis : {&x_, &y_, &z_}) axis->clear();
  all_.clear();
  std::vector<const Oriented*> buckets;  // from `from` on
  for (std::size_t b = from; b < store_.buckets(); ++b) {
    buckets.push_back(nullptr);
    if (store_.count(b) == 0) continue;
    if (b >= end_ && store_.z_lower(b) > high_ + halo_) break;
    const Oriented& bucket = read(b);
    buckets.back() = &bucket;
    for (std::size_t i = 0; i < bucket.x.size(); ++i) {
      if (bucket.z[i] < low_ - halo_ || bucket.z[i] > high_ + halo_ || !masks_[b][i]) continue;
      x_.push_back(bucket.x[i]);
      y_.push_back(bucket.y[i]);
      z_.push_back(bucket.z[i]);
      all_.push_back({static_cast<std::uint32_t>(b), static_cast<std::uint32_t>(i)});
    }
  }
  tree_.assign(x_, y_, z_);
  put_in_order(buckets, from);
}

/// By place of the tree.
void Neighbourhoods::put_in_order(const std::vector<const Oriented*>& buckets, std::size_t from) {
  const std::vector<std::uint32_t>& order = tree_.order();
  samples_.x = tree_.axis(0);
  samples_.y = tree_.axis(1);
  samples_.z = tree_.axis(2);
  for (auto* normals : {&samples_.nx, &samples_.ny, &samples_.nz}) resize_anew(*normals, order.size());
  for (auto* numbers : {&samples_.bucket, &samples_.number}) resize_anew(*numbers, order.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, order.size(), 4096), [&](const auto& range) {
    for (std::size_t p = range.begin(); p < range.end(); ++p) {
      const InStore& at = all_[order[p]];
      const Oriented& bucket = *buckets[at.bucket - from];
      samples_.nx[p] = bucket.nx[at.number];
      samples_.ny[p] = bucket.ny[at.number];
      samples_.nz[p] = bucket.nz[at.number];
      samples_.bucket[p] = at.bucket;
      samples_.number[p] = at.number;
    }
  });
}

const Neighbourhoods::Oriented& Neighbourhoods::read(std::size_t b) {
  if (const auto known = held_.find(b); known != held_.end()) return known->second;
  store_.read(b, local_);
  if (!spare_.empty()) {
    spare_.back().key() = b;
    held_.insert(std::move(spare_.back()));
    spare_.pop_back();
  }
  Oriented& to = held_[b];
  to.x.swap(local_.x);
  to.y.swap(local_.y);
  to.z.swap(local_.z);
  to.nx.swap(local_.nx);
  to.ny.swap(local_.ny);
  to.nz.swap(local_.nz);
  return to;
}

}  // namespace lamina

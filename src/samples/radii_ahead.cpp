#include "samples/radii_ahead.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <utility>

namespace lamina {
namespace {

/// Samples beyond those being read that the system is told of.
constexpr std::uint64_t kAnnounced = 6 * kSamplesTogether;

/// The first bucket from which on there are at least so many samples between `begin` and it.
std::size_t end_of(const SlabStore& store, std::size_t begin, std::uint64_t samples) {
  std::uint64_t held = 0;
  while (begin < store.buckets() && held < samples) held += store.count(begin++);
  return begin;
}

}  // namespace

RadiiAhead::RadiiAhead(const SlabStore& store, const Lattice& lattice, const RadiiSettings& settings)
    : store_(store), lattice_(lattice), estimator_(settings) {}

RadiiAhead::~RadiiAhead() {
  try {
    tasks_.wait();
  } catch (...) {  // the caller has its own reason to leave
  }
}

void RadiiAhead::begin_at(std::size_t bucket) {
  read_ = announced_ = pushed_ = measured_ = bucket;
}

void RadiiAhead::measure_below(std::int64_t z) {
  tasks_.wait();  // one thing after the other
  tasks_.run([this, z] {
    const auto wanted = [&] {
      const std::size_t next = store_.next_filled(measured_);
      return next < store_.buckets() && store_.z_lower(next) < z;
    };
    tbb::this_task_arena::isolate([&] {
      while (wanted()) measure_next();
    });
  });
}

std::vector<RadiiAhead::Measured> RadiiAhead::take() {
  tasks_.wait();
  return std::exchange(done_, {});
}

void RadiiAhead::measure_next() {
  if (std::vector<float> radii; estimator_.pop(radii)) {
    done_.push_back({std::move(radii), std::move(orders_.front())});
    orders_.pop_front();
    ++measured_;
    return;
  }
  if (waiting_.empty()) read_next();
  if (waiting_.front().error) std::rethrow_exception(waiting_.front().error);
  estimator_.push(waiting_.front().samples);
  orders_.push_back(std::move(waiting_.front().order));
  waiting_.pop_front();
  if (++pushed_ == store_.buckets()) estimator_.finish();
}

void RadiiAhead::read_next() {
  const std::size_t begin = read_;
  read_ = end_of(store_, begin, kSamplesTogether);
  const std::size_t announced = end_of(store_, read_, kAnnounced);
  for (announced_ = std::max(announced_, read_); announced_ < announced; ++announced_) store_.will_read(announced_);
  waiting_.resize(read_ - begin);
  tbb::parallel_for(std::size_t{0}, waiting_.size(), [&](std::size_t k) { read(begin + k, waiting_[k]); });
}

void RadiiAhead::read(std::size_t bucket, Positions& out) const {
  if (store_.count(bucket) == 0) return;
  // A thread that waits for others here must not begin with another bucket: that would be twice the scratch.
  tbb::this_task_arena::isolate([&] {
    try {
      store_.read(bucket, out.samples, Columns::positions);
      BlockOrderScratch scratch;
      out.order = order_by_block(out.samples, lattice_, scratch);
      put_in_order(out.samples, out.order, scratch);
    } catch (...) {
      out.error = std::current_exception();
    }
  });
}

}  // namespace lamina

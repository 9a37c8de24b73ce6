#include "samples/bucket_runs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace lamina {

ReadBucket reader_of(const SlabStore& store) {
  return [&store](std::size_t bucket, LocalSamples& out) { store.read(bucket, out); };
}

std::uint64_t samples_in(const SlabStore& store, BucketSpan run) {
  std::uint64_t n = 0;
  for (std::size_t b = run.begin; b < run.end; ++b) n += store.count(b);
  return n;
}

ZRange z_range(const SlabStore& store, BucketSpan run) {
  ZRange z{std::numeric_limits<std::int32_t>::max(), std::numeric_limits<std::int32_t>::min()};
  for (std::size_t b = run.begin; b < run.end; ++b) {
    z.low = std::min(z.low, store.z_lower(b));
    z.high = std::max(z.high, store.z_upper(b));
  }
  return z;
}

LocalSamples read_oriented(const SlabStore& store, const ReadBucket& read, BucketSpan run) {
  LocalSamples all, bucket;
  const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
  for (std::size_t b = run.begin; b < run.end; ++b) {
    if (store.count(b) == 0) continue;
    read(b, bucket);
    append(all.x, bucket.x);
    append(all.y, bucket.y);
    append(all.z, bucket.z);
    append(all.nx, bucket.nx);
    append(all.ny, bucket.ny);
    append(all.nz, bucket.nz);
    append(all.radius, bucket.radius);
  }
  return all;
}

SeedNeighbourhoods::SeedNeighbourhoods(const LocalSamples& samples, double reach, std::vector<std::size_t> seeds)
    : samples_(samples), inverse_(1 / reach), seeds_(std::move(seeds)) {
  for (const std::size_t seed : seeds_) {
    for (int k = 0; k < 27; ++k) cells_[beside(cell_of(seed), k)];
  }
  if (cells_.empty()) return;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto at = cells_.find(cell_of(i));
    if (at != cells_.end()) at->second.push_back(static_cast<std::uint32_t>(i));
  }
}

SeedNeighbourhoods::Cell SeedNeighbourhoods::cell_of(std::size_t i) const {
  return {static_cast<std::int64_t>(std::floor(samples_.x[i] * inverse_)),
          static_cast<std::int64_t>(std::floor(samples_.y[i] * inverse_)),
          static_cast<std::int64_t>(std::floor(samples_.z[i] * inverse_))};
}

}  // namespace lamina

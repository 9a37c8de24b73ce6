#include "store/bucket_buffers.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <numeric>

namespace lamina {

BucketBuffers::BucketBuffers(const SampleColumns& columns, std::size_t buckets, std::size_t pool_bytes)
    : columns_(columns),
      chunk_bytes_(kChunkRows * columns.row_bytes()),
      head_(buckets, kNone),
      tail_(buckets, kNone),
      count_(buckets, 0) {
  constexpr std::size_t most = kNone / kChunkRows;  // slots are 32 bits
  next_.resize(std::clamp<std::size_t>(pool_bytes / chunk_bytes_, 1, most));
  pool_ = std::make_unique_for_overwrite<std::byte[]>(chunks() * chunk_bytes_);
}

std::uint32_t BucketBuffers::take_chunk() {
  ++used_;
  if (free_ == kNone) return fresh_++;
  const std::uint32_t chunk = free_;
  free_ = next_[chunk];
  return chunk;
}

std::size_t BucketBuffers::add(const LocalSamples& samples, const PackedNormals& normals, std::size_t first,
                               std::span<const std::uint32_t> bucket_of) {
  arriving_slots_.clear();
  place_.assign(buckets() + 1, 0);
  for (const std::uint32_t bucket : bucket_of) {
    const auto row = static_cast<std::uint32_t>(count_[bucket] % kChunkRows);
    if (row == 0) {
      if (free_chunks() == 0) break;
      const std::uint32_t chunk = take_chunk();
      (count_[bucket] == 0 ? head_[bucket] : next_[tail_[bucket]]) = chunk;
      tail_[bucket] = chunk;
    }
    ++count_[bucket];
    ++place_[bucket + 1];
    arriving_slots_.push_back(tail_[bucket] * kChunkRows + row);
  }
  const std::size_t added = arriving_slots_.size();
  std::partial_sum(place_.begin(), place_.end(), place_.begin());
  rows_.resize(added);
  slots_.resize(added);
  for (std::size_t i = 0; i < added; ++i) {
    const std::uint32_t to = place_[bucket_of[i]]++;
    rows_[to] = static_cast<std::uint32_t>(first + i);
    slots_[to] = arriving_slots_[i];
  }
  const auto scatter = [&](std::size_t column) {
    columns_.scatter(samples, normals, column, rows_, slots_, pool_.get());
  };
  tbb::parallel_for(std::size_t{0}, columns_.size(), scatter);
  return added;
}

std::vector<const std::byte*> BucketBuffers::chunks_of(std::size_t bucket) const {
  std::vector<const std::byte*> chunks((count_[bucket] + kChunkRows - 1) / kChunkRows);
  std::uint32_t chunk = head_[bucket];
  for (auto& c : chunks) {
    c = pool_.get() + chunk * chunk_bytes_;
    chunk = next_[chunk];
  }
  return chunks;
}

void BucketBuffers::release(std::size_t bucket) {
  if (count_[bucket] == 0) return;
  used_ -= (count_[bucket] + kChunkRows - 1) / kChunkRows;
  next_[tail_[bucket]] = free_;
  free_ = head_[bucket];
  count_[bucket] = 0;
}

}  // namespace lamina

// Samples waiting for the disk, sorted into buckets: chunks of a fixed pool, chained per bucket.
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "store/columns.h"

namespace lamina {

class BucketBuffers {
 public:
  /// The pool takes pool_bytes, rounded down to chunks, at least one chunk. Its memory is touched only as it is used.
  BucketBuffers(const SampleColumns& columns, std::size_t buckets, std::size_t pool_bytes);

  /// Adds rows [first, first + bucket_of.size()), less than 2^32 in all, to their buckets until the pool is full;
  /// returns how many went in.
  std::size_t add(const LocalSamples& samples, const PackedNormals& normals, std::size_t first,
                  std::span<const std::uint32_t> bucket_of);
  [[nodiscard]] std::size_t buckets() const { return count_.size(); }
  [[nodiscard]] std::size_t waiting(std::size_t bucket) const { return count_[bucket]; }
  [[nodiscard]] std::size_t chunks() const { return next_.size(); }
  [[nodiscard]] std::size_t free_chunks() const { return chunks() - used_; }
  /// The bucket's chunks in order, each full but the last.
  [[nodiscard]] std::vector<const std::byte*> chunks_of(std::size_t bucket) const;
  /// Empties a bucket.
  void release(std::size_t bucket);

 private:
  static constexpr std::uint32_t kNone = ~0U;
  [[nodiscard]] std::uint32_t take_chunk();

  const SampleColumns& columns_;
  std::size_t chunk_bytes_;
  std::size_t used_ = 0;
  std::uint32_t fresh_ = 0;          ///< chunks from here on have never been used
  std::uint32_t free_ = kNone;       ///< chain of released chunks
  std::vector<std::uint32_t> next_;  ///< chain, per chunk
  std::vector<std::uint32_t> head_, tail_;
  std::vector<std::size_t> count_;
  std::vector<std::uint32_t> arriving_slots_;  ///< of the rows of one add()
  std::vector<std::uint32_t> place_;           ///< per bucket: where its rows begin in the arrays below
  std::vector<std::uint32_t> rows_, slots_;    ///< the same sorted by bucket, so that writes run along the chunks
  std::unique_ptr<std::byte[]> pool_;
};

}  // namespace lamina

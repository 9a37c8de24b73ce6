// Fills a store: samples wait in a pool, bucket by bucket, and go to disk in compressed blocks.
#include <tbb/parallel_for.h>
#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "lamina/error.h"
#include "lattice/lattice.h"
#include "store/block_codec.h"
#include "store/slab_store.h"

namespace lamina {
namespace {

/// Samples waiting for the disk, sorted into buckets: chunks of a fixed pool, chained per bucket.
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

/// Samples taken from a batch at a time: their bucket numbers and slots stay in the cache.
constexpr std::size_t kPieceRows = 32768;

/// Blocks being compressed or written at once, at most.
constexpr std::size_t kBlocksInFlight = 16;

/// Buffers on their way to the disk.
constexpr std::size_t kBuffersInFlight = 16;

/// Files of a store; one for as few buckets as give back little.
constexpr std::size_t kFiles = 16;
constexpr std::size_t kBucketsPerFile = 8;

/// Part of a bucket on its way to the disk.
struct Piece {
  std::size_t bucket = 0;
  std::vector<const std::byte*> chunks;
  std::size_t count = 0;
  std::int32_t z_lower = 0, z_upper = 0;
  std::unique_ptr<std::uint32_t[]> scratch;
  std::unique_ptr<std::byte[]> block;
  std::size_t bytes = 0;  ///< of the block
};

void find_z_range(const SampleColumns& columns, Piece& piece) {
  piece.z_lower = std::numeric_limits<std::int32_t>::max();
  piece.z_upper = std::numeric_limits<std::int32_t>::min();
  std::size_t left = piece.count;
  for (const std::byte* chunk : piece.chunks) {
    const auto* z = reinterpret_cast<const std::int32_t*>(chunk + kChunkRows * columns.bytes_before(2));
    const std::size_t rows = std::min<std::size_t>(left, kChunkRows);
    for (std::size_t i = 0; i < rows; ++i) {
      piece.z_lower = std::min(piece.z_lower, z[i]);
      piece.z_upper = std::max(piece.z_upper, z[i]);
    }
    left -= rows;
  }
}

}  // namespace

struct SlabStoreWriter::Impl {
  Impl(const StoreLayout& layout, const StoreSettings& s)
      : settings(s),
        store(new SlabStore::Impl{SampleColumns(layout), layout, make_files(s), std::vector<BucketIndex>(s.buckets), 0,
                                  0, s.keep ? s.directory : std::string()}),
        buffers(store->columns, s.buckets, s.buffer_bytes - s.buffer_bytes / 4),
        block_rows(block_rows_for(s.buffer_bytes / 4 / (store->columns.row_bytes() + sizeof(std::uint32_t)))) {}

  /// A quarter of the budget is for the blocks in flight; what a block holds must not depend on the number of threads.
  [[nodiscard]] static std::size_t block_rows_for(std::size_t rows_in_flight) {
    return std::clamp<std::size_t>(rows_in_flight / kBlocksInFlight / kChunkRows * kChunkRows, 1024, kBlockRows);
  }
  [[nodiscard]] static std::vector<SpillFile> make_files(const StoreSettings& s) {
    std::vector<SpillFile> files;
    const std::size_t n = std::clamp<std::size_t>(s.buckets / kBucketsPerFile, 1, kFiles);
    while (files.size() < n) {
      s.keep ? files.emplace_back(s.directory, store_file_name(files.size())) : files.emplace_back(s.directory);
    }
    return files;
  }
  void pack(const LocalSamples& samples);
  void find_buckets(const LocalSamples& samples, std::size_t first, std::size_t count);
  void flush_fullest();
  void flush(std::span<const std::size_t> which);

  StoreSettings settings;
  std::unique_ptr<SlabStore::Impl> store;
  BucketBuffers buffers;
  std::size_t block_rows;
  std::vector<std::uint32_t> bucket_of;
  PackedNormals normals;  ///< of the samples being appended
  std::array<Piece, kBlocksInFlight> pieces;
  BackgroundWriter disk{SpillFile::kBufferBytes, kBuffersInFlight};
};

void SlabStoreWriter::Impl::pack(const LocalSamples& s) {
  normals.resize(s.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, s.size(), 8192), [&](const auto& range) {
    const std::size_t i = range.begin();
    pack_normals({s.nx.data() + i, s.ny.data() + i, s.nz.data() + i}, range.size(),
                 {normals.u.data() + i, normals.v.data() + i, normals.low.data() + i});
  });
}

void SlabStoreWriter::Impl::find_buckets(const LocalSamples& samples, std::size_t first, std::size_t count) {
  const std::int64_t last = settings.z_min + static_cast<std::int64_t>(settings.buckets - 1) * settings.bucket_height;
  const auto highest =
      static_cast<std::int32_t>(std::min<std::int64_t>(last, std::numeric_limits<std::int32_t>::max()));
  const FloorDivider bucket(settings.bucket_height, settings.z_min);
  bucket_of.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::int32_t z = std::clamp(samples.z[first + i], settings.z_min, highest);
    bucket_of[i] = static_cast<std::uint32_t>(bucket(z));
  }
}

/// Long blocks compress better and keep the index small, so only as many buckets go as free a quarter of the pool.
void SlabStoreWriter::Impl::flush_fullest() {
  std::vector<std::size_t> order(buffers.buckets());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return buffers.waiting(a) > buffers.waiting(b); });
  const std::size_t wanted = std::max<std::size_t>(1, buffers.chunks() / 4);
  std::size_t freed = buffers.free_chunks();
  std::size_t n = 0;
  while (n < order.size() && freed < wanted) freed += (buffers.waiting(order[n++]) + kChunkRows - 1) / kChunkRows;
  std::sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(n));
  flush(std::span(order).first(n));
}

void SlabStoreWriter::Impl::flush(std::span<const std::size_t> which) {
  const auto& columns = store->columns;
  std::size_t at = 0;
  std::size_t done = 0;  // samples of bucket which[at] that are on their way
  std::size_t turn = 0;
  std::vector<const std::byte*> chunks;
  const auto next_piece = [&](tbb::flow_control& control) -> Piece* {
    while (at < which.size() && done == buffers.waiting(which[at])) {
      ++at;
      done = 0;
    }
    if (at == which.size()) {
      control.stop();
      return nullptr;
    }
    const std::size_t bucket = which[at];
    if (done == 0) chunks = buffers.chunks_of(bucket);
    // Written in order, pieces in flight are successive ones: the one before in this place has been written.
    Piece& piece = pieces[turn++ % kBlocksInFlight];
    piece.bucket = bucket;
    piece.count = std::min(block_rows, buffers.waiting(bucket) - done);
    const auto begin = chunks.begin() + static_cast<std::ptrdiff_t>(done / kChunkRows);
    piece.chunks.assign(begin, begin + static_cast<std::ptrdiff_t>((piece.count + kChunkRows - 1) / kChunkRows));
    done += piece.count;
    return &piece;
  };
  const auto compress = [&](Piece* piece) {
    const std::size_t bound = block_bound(columns, block_rows);
    if (!piece->block) {
      piece->block = std::make_unique_for_overwrite<std::byte[]>(bound);
      piece->scratch = std::make_unique_for_overwrite<std::uint32_t[]>(block_rows);
    }
    piece->bytes = encode_block(columns, piece->chunks, piece->count, {piece->scratch.get(), block_rows},
                                {piece->block.get(), bound});
    find_z_range(columns, *piece);
    return piece;
  };
  const auto write = [&](Piece* piece) {
    BucketIndex& index = store->buckets[piece->bucket];
    if (settings.keep) index.checksums.push_back(block_checksum({piece->block.get(), piece->bytes}));
    const std::uint64_t offset = store->file_of(piece->bucket).append({piece->block.get(), piece->bytes}, disk);
    index.blocks.push_back(
        {offset, static_cast<std::uint32_t>(piece->bytes), static_cast<std::uint32_t>(piece->count)});
    index.count += piece->count;
    index.z_lower = std::min(index.z_lower, piece->z_lower);
    index.z_upper = std::max(index.z_upper, piece->z_upper);
  };
  tbb::parallel_pipeline(kBlocksInFlight,
                         tbb::make_filter<void, Piece*>(tbb::filter_mode::serial_in_order, next_piece) &
                             tbb::make_filter<Piece*, Piece*>(tbb::filter_mode::parallel, compress) &
                             tbb::make_filter<Piece*, void>(tbb::filter_mode::serial_in_order, write));
  for (const std::size_t bucket : which) buffers.release(bucket);
}

SlabStoreWriter::SlabStoreWriter(StoreLayout layout, StoreSettings settings) {
  if (settings.bucket_height <= 0 || settings.buckets == 0) {
    throw Error(ExitCode::internal, "slab store: bucket height and number of buckets must be positive");
  }
  impl_ = std::make_unique<Impl>(layout, settings);
}

SlabStoreWriter::~SlabStoreWriter() = default;

void SlabStoreWriter::append(const LocalSamples& samples) {
  if (!impl_) throw Error(ExitCode::internal, "slab store: append after finish");
  impl_->store->columns.check(samples);
  impl_->pack(samples);
  for (std::size_t first = 0; first < samples.size(); first += kPieceRows) {
    const std::size_t count = std::min(kPieceRows, samples.size() - first);
    impl_->find_buckets(samples, first, count);
    std::span<const std::uint32_t> left = impl_->bucket_of;
    while (!left.empty()) {
      const std::size_t added = impl_->buffers.add(samples, impl_->normals, first + count - left.size(), left);
      left = left.subspan(added);
      if (!left.empty()) impl_->flush_fullest();
    }
  }
  impl_->store->total += samples.size();
}

SlabStore SlabStoreWriter::finish() {
  if (!impl_) throw Error(ExitCode::internal, "slab store: finished twice");
  std::vector<std::size_t> all(impl_->buffers.buckets());
  std::iota(all.begin(), all.end(), std::size_t{0});
  impl_->flush(all);
  for (SpillFile& file : impl_->store->files) file.flush(impl_->disk);
  impl_->store->files.front().check(impl_->disk.drain());
  SlabStore store(std::move(impl_->store));
  impl_.reset();
  return store;
}

}  // namespace lamina

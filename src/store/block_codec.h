// How samples rest on disk: columns in types of their own, normals packed, and blocks - runs of a bucket's samples -
// with each column compressed on its own.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/spill_file.h"
#include "store/slab_store.h"

namespace lamina {

/// Unit normals at rest: octahedral coordinates of 24 bits, as exact as the floats they come from. Two coordinates'
/// high 16 bits, and both their low bytes together.
struct PackedNormals {
  std::vector<std::uint16_t> u, v, low;
  void resize(std::size_t n) {
    for (auto* values : {&u, &v, &low}) values->resize(n);
  }
};

/// Arrays of x, y, z to arrays of u, v, low. Normals of any length but zero (which becomes +z). Axis-aligned ones come
/// back exactly, others within 5e-7.
void pack_normals(const std::array<const float*, 3>& normals, std::size_t count,
                  const std::array<std::uint16_t*, 3>& packed);

/// Unit normals.
void unpack_normals(const std::array<const std::uint16_t*, 3>& packed, std::size_t count,
                    const std::array<float*, 3>& normals);

/// Samples wait for the disk in chunks of this many: small, as every bucket has one that is partly filled.
inline constexpr std::uint32_t kChunkRows = 64;

/// Columns in the order they are stored: x y z, three of the normal (PackedNormals), [radius], [quality], attributes.
class SampleColumns {
 public:
  explicit SampleColumns(const StoreLayout& layout);
  [[nodiscard]] std::size_t size() const { return types_.size(); }
  /// Bytes of one value of a column at rest.
  [[nodiscard]] std::size_t bytes(std::size_t column) const {
    return static_cast<std::size_t>(byte_size(types_[column]));
  }
  /// Sum of the columns before this one; of all of them for column == size().
  [[nodiscard]] std::size_t bytes_before(std::size_t column) const { return bytes_before_[column]; }
  [[nodiscard]] std::size_t row_bytes() const { return bytes_before_.back(); }
  /// Positions: int32 on both sides, worth an offset or a difference before compression.
  [[nodiscard]] static bool is_position(std::size_t column) { return column < 3; }
  [[nodiscard]] static bool is_normal(std::size_t column) { return column >= 3 && column < 6; }
  /// The lowest bits of a measurement: compressing them is time lost.
  [[nodiscard]] static bool is_noise(std::size_t column) { return column == 5; }
  /// At rest as it is in memory: no conversion on reading.
  [[nodiscard]] bool is_direct(std::size_t column) const {
    return is_position(column) || types_[column] == ScalarType::float32;
  }

  /// Throws Error(internal) when an array the layout promises is missing or of another length.
  void check(const LocalSamples& samples) const;
  /// Sizes all arrays of the layout to n, those that are not wanted to none, and empties the optional ones it lacks.
  void resize(LocalSamples& samples, std::size_t n, Columns wanted = Columns::all) const;
  /// Value rows[i] goes to slots[i], converted to the column's type: rounded and clamped for integers, NaN as zero.
  /// Slot s is row s % kChunkRows of chunk s / kChunkRows; a chunk holds kChunkRows values of each column in turn.
  /// Normals come packed.
  void scatter(const LocalSamples& samples, const PackedNormals& normals, std::size_t column,
               std::span<const std::uint32_t> rows, std::span<const std::uint32_t> slots, std::byte* chunks) const;
  /// Where a column's values live in memory, as bytes.
  [[nodiscard]] std::byte* data(LocalSamples& samples, std::size_t column) const;
  /// Converts `count` values at rest into rows [first, first + count) of a column that is not direct.
  void convert(const std::byte* rest, std::size_t count, LocalSamples& samples, std::size_t column,
               std::size_t first) const;

 private:
  [[nodiscard]] const std::vector<float>& floats(const LocalSamples& samples, std::size_t column) const;
  [[nodiscard]] std::vector<float>& floats(LocalSamples& samples, std::size_t column) const;

  bool has_radius_, has_quality_;
  std::size_t first_attribute_ = 0;  ///< column
  std::vector<ScalarType> types_;
  std::vector<std::size_t> bytes_before_;
};

/// Where a block lies in the file.
struct BlockEntry {
  std::uint64_t offset = 0;
  std::uint32_t bytes = 0;
  std::uint32_t count = 0;  ///< samples
};

/// Most samples in one block: bounds the scratch memory and leaves work for several threads in one bucket.
inline constexpr std::size_t kBlockRows = 16384;

/// Room a block of `rows` rows can need.
[[nodiscard]] std::size_t block_bound(const SampleColumns& columns, std::size_t rows);

/// Compresses `count` rows lying in `chunks` in order, each chunk full but the last, into `block` (block_bound(count)
/// bytes) and returns the bytes used: a function of the rows alone. `scratch` holds `count` values.
std::size_t encode_block(const SampleColumns& columns, std::span<const std::byte* const> chunks, std::size_t count,
                         std::span<std::uint32_t> scratch, std::span<std::byte> block);

/// Decompresses a block of `count` rows into rows [first, first + count) of `out`, which has been sized for them.
/// Distinct rows may be decoded from several threads. False when the bytes are not such a block.
[[nodiscard]] bool decode_block(const SampleColumns& columns, std::span<const std::byte> block, std::size_t count,
                                LocalSamples& out, std::size_t first, Columns wanted = Columns::all);

// What a finished store consists of, for the writer that makes it and the store that reads it; and its blocks as they
// rest on disk, for moving them between stores without unpacking them.

struct BucketIndex {
  std::vector<BlockEntry> blocks;        ///< in the order of append()
  std::vector<std::uint32_t> checksums;  ///< of the blocks, where the store is kept
  std::uint64_t count = 0;
  std::vector<bool> keep{};  ///< of the samples in the blocks, which stay; empty: all
  std::int32_t z_lower = std::numeric_limits<std::int32_t>::max();
  std::int32_t z_upper = std::numeric_limits<std::int32_t>::min();
};

/// CRC-32 of a block as it lies in the file.
std::uint32_t block_checksum(std::span<const std::byte> block);
/// Name of a kept store's file.
std::string store_file_name(std::size_t file);

struct SlabStore::Impl {
  SampleColumns columns;
  StoreLayout layout;
  std::vector<SpillFile> files;  ///< each holds a run of buckets, so that the disk they take can be given back
  std::vector<BucketIndex> buckets;
  std::uint64_t total = 0;
  std::size_t released = 0;  ///< files before this one are gone
  std::string directory;     ///< where the store is kept; empty: it is not

  [[nodiscard]] SpillFile& file_of(std::size_t bucket) { return files[bucket * files.size() / buckets.size()]; }
};

/// The insides of a store, for those that move its blocks.
struct StoreAccess {
  using Impl = SlabStore::Impl;
  static Impl& of(SlabStore& store) { return *store.impl_; }
  static const Impl& of(const SlabStore& store) { return *store.impl_; }
  static SlabStore make(std::unique_ptr<Impl> impl) { return SlabStore(std::move(impl)); }
};

/// What is known of a bucket without its samples; the greatest and the least int32 where it has none.
struct BucketShare {
  std::uint64_t count = 0;
  std::int32_t z_lower = std::numeric_limits<std::int32_t>::max();
  std::int32_t z_upper = std::numeric_limits<std::int32_t>::min();
};

std::vector<BucketShare> bucket_shares(const SlabStore& store);

/// Says that a store is one of several and its buckets hold, taken together, what `all` says: from here on it gives
/// those counts, and read() works where the others have nothing. Its blocks stay what they are.
void declare_shares(SlabStore& store, const std::vector<BucketShare>& all);

/// A store's own blocks of a bucket, in order.
std::span<const BlockEntry> blocks_of(const SlabStore& store, std::size_t bucket);

/// Fills `out`, as long as the block. Throws as SlabStore::read() does.
void read_block(const SlabStore& store, std::size_t bucket, const BlockEntry& block, std::span<std::byte> out);

/// A block on its way.
struct CodedBlock {
  std::uint32_t count = 0;  ///< samples
  std::span<const std::byte> bytes;
};

/// Unpacks blocks, one after the other, as SlabStore::read() does. Throws Error(internal) for what is none.
void decode_blocks(const StoreLayout& layout, std::span<const CodedBlock> blocks, LocalSamples& out);

/// Puts a store together from blocks of several: of each bucket first those of source 0, then those of source 1, ...
class StoreGatherer {
 public:
  /// `all`: what the buckets hold in all sources together. Throws as SlabStoreWriter.
  StoreGatherer(const StoreLayout& layout, const std::string& directory, const std::vector<BucketShare>& all,
                std::size_t sources);
  /// Blocks of one bucket and one source come in their order; else in any. Throws Error(budget) when the disk is full,
  /// Error(internal) for a bucket or source that is none.
  void add(std::size_t bucket, std::size_t source, const CodedBlock& block);
  /// The store, which holds what was added; buckets may be left out. The gatherer is spent.
  SlabStore finish();

 private:
  std::unique_ptr<StoreAccess::Impl> store_;
  std::vector<std::vector<std::vector<BlockEntry>>> blocks_;  ///< by bucket, then by source; empty until there are some
  std::size_t sources_;
  BackgroundWriter disk_;
};

}  // namespace lamina

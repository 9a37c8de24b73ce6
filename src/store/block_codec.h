// How samples rest on disk: columns in types of their own, normals packed, and blocks - runs of a bucket's samples -
// with each column compressed on its own.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

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
  /// Sizes all arrays of the layout to n, and empties the optional ones it lacks.
  void resize(LocalSamples& samples, std::size_t n) const;
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
                                LocalSamples& out, std::size_t first);

}  // namespace lamina

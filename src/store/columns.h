// The columns of a sample in the store: what type each rests in, and how values get into and out of it.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "store/slab_store.h"
#include "store/unit_normal.h"

namespace lamina {

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

}  // namespace lamina

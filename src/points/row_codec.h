// Rows of points as bytes and back: x y z, nx ny nz, radius, quality, attributes, each in its own type, little-endian,
// without gaps.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "lamina/points_writer.h"

namespace lamina {

class RowCodec {
 public:
  explicit RowCodec(const PointColumns& columns);
  [[nodiscard]] std::size_t row_bytes() const { return row_bytes_; }

  /// Throws Error(internal) when an array the columns need is missing or shorter than the batch, or a number is not
  /// finite in the type it is written as; `first` is the number of the batch's first row and `name` the file's, for the
  /// message.
  void require_writable(const SampleBatch& batch, std::uint64_t first, const std::string& name) const;
  /// Writes rows [first, first + count) of a batch that is writable. Floats are rounded to integers and clamped.
  void encode(const SampleBatch& batch, std::size_t first, std::size_t count, std::byte* out) const;
  /// The batch of `count` rows that stand `stride` bytes apart.
  void decode(const std::byte* rows, std::size_t stride, std::size_t count, SampleBatch& out) const;

 private:
  PointColumns columns_;
  std::size_t row_bytes_ = 0;
};

}  // namespace lamina

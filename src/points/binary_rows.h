// Rows of fixed size, read a block at a time and taken apart column by column.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "points/input_file.h"
#include "points/point_columns.h"

namespace lamina {

/// Where rows lie in a file.
struct BinaryRows {
  std::uint64_t data = 0;  ///< offset of row 0
  std::size_t stride = 0;  ///< bytes of a row
  bool swapped = false;    ///< the other byte order than this machine's
};

/// Fills the targets with rows [first, first + count). From any thread.
/// Throws Error(unreadable) when the file has become shorter since it was opened.
void read_binary_rows(const InputFile& file, const BinaryRows& rows, const std::vector<PointColumn>& columns,
                      std::uint64_t first, std::size_t count, const std::vector<ColumnTarget>& targets);

}  // namespace lamina

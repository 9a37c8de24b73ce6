#include "points/binary_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "base/read_bytes.h"
#include "lamina/error.h"
#include "points/ply_columns.h"

namespace lamina {
namespace {

/// Bytes converted column by column at once: they stay in the first-level cache across the columns.
constexpr std::size_t kConvertBytes = 12 << 10;

/// `n` rows to the places from `at` on.
void convert(const BinaryRows& layout, const std::vector<PointColumn>& columns, const std::byte* bytes, std::size_t at,
             std::size_t n, const std::vector<ColumnTarget>& targets) {
  const std::size_t block = std::max<std::size_t>(1, kConvertBytes / layout.stride);
  for (std::size_t done = 0; done < n; done += block) {
    const std::size_t rows = std::min(block, n - done);
    for (std::size_t c = 0; c < targets.size(); ++c) {
      const std::byte* from = bytes + done * layout.stride + columns[c].offset;
      if (targets[c].wide != nullptr) {
        convert_column(columns[c].type, layout.swapped, from, layout.stride, rows, targets[c].wide + at + done);
      } else if (targets[c].narrow != nullptr) {
        convert_column(columns[c].type, layout.swapped, from, layout.stride, rows, targets[c].narrow + at + done);
      }
    }
  }
}

}  // namespace

void read_binary_rows(const InputFile& file, const BinaryRows& rows, const std::vector<PointColumn>& columns,
                      std::uint64_t first, std::size_t count, const std::vector<ColumnTarget>& targets) {
  // Read, not mapped: mapped bytes count as resident memory afterwards.
  const std::size_t block = std::max<std::size_t>(1, kReadBytes / rows.stride);
  const auto buffer = std::make_unique_for_overwrite<std::byte[]>(std::min(block, count) * rows.stride);
  for (std::size_t done = 0; done < count; done += block) {
    const std::size_t n = std::min(block, count - done);
    const std::uint64_t offset = rows.data + (first + done) * rows.stride;
    if (const std::size_t got = file.read(offset, buffer.get(), n * rows.stride); got < n * rows.stride) {
      throw Error(ExitCode::unreadable, fmt::format("{}: ends at row {}, it was complete when it was opened: is it "
                                                    "being written?",
                                                    file.name, first + done + got / rows.stride));
    }
    convert(rows, columns, buffer.get(), done, n, targets);
  }
}

}  // namespace lamina

#include "points/ply_binary.h"

#include <fmt/format.h>

#include <algorithm>

#include "lamina/error.h"
#include "points/ply_columns.h"
#include "points/ply_walk.h"

namespace lamina {
namespace {

/// Bytes read from the file at once: they stay in the second-level cache until converted, and unlike a mapping they do
/// not count as resident memory afterwards.
constexpr std::size_t kReadBytes = 128 << 10;
/// Bytes converted column by column at once: they stay in the first-level cache across the columns.
constexpr std::size_t kConvertBytes = 12 << 10;

class BinaryPly final : public PointSource {
 public:
  BinaryPly(InputFile file, const PlyHeader& header, PlyRows rows)
      : file_(std::move(file)),
        rows_(std::move(rows)),
        swapped_(is_swapped(header.format)),
        data_(locate_element(file_, header, rows_.element)) {
    info_ = rows_.info;
    info_.random_access = true;
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    first = std::min(first, info_.count);
    count = static_cast<std::size_t>(std::min<std::uint64_t>(count, info_.count - first));
    const std::vector<ColumnTarget> targets = prepare_batch(rows_, first, count, out);
    const std::size_t block = std::max<std::size_t>(1, kReadBytes / rows_.stride);
    const auto buffer = std::make_unique_for_overwrite<std::byte[]>(block * rows_.stride);
    for (std::size_t done = 0; done < count; done += block) {
      const std::size_t n = std::min(block, count - done);
      const std::uint64_t offset = data_ + (first + done) * rows_.stride;
      if (const std::size_t got = file_.read(offset, buffer.get(), n * rows_.stride); got < n * rows_.stride) {
        throw Error(ExitCode::unreadable, fmt::format("{}: ends at row {}, it was complete when it was opened: is it "
                                                      "being written?",
                                                      file_.name, first + done + got / rows_.stride));
      }
      convert(buffer.get(), done, n, targets);
    }
    round_exact_attributes(out);
  }

 private:
  /// `n` rows to the places from `at` on.
  void convert(const std::byte* bytes, std::size_t at, std::size_t n, const std::vector<ColumnTarget>& targets) const {
    const std::size_t block = std::max<std::size_t>(1, kConvertBytes / rows_.stride);
    for (std::size_t done = 0; done < n; done += block) {
      const std::size_t rows = std::min(block, n - done);
      for (std::size_t c = 0; c < targets.size(); ++c) {
        const PlyColumn& column = rows_.columns[c];
        const std::byte* from = bytes + done * rows_.stride + column.offset;
        if (targets[c].wide != nullptr) {
          convert_column(column.type, swapped_, from, rows_.stride, rows, targets[c].wide + at + done);
        } else {
          convert_column(column.type, swapped_, from, rows_.stride, rows, targets[c].narrow + at + done);
        }
      }
    }
  }

  InputFile file_;
  PlyRows rows_;
  bool swapped_;
  std::uint64_t data_;  ///< offset of row 0
};

}  // namespace

std::unique_ptr<PointSource> open_binary_ply(InputFile file, const PlyHeader& header, PlyRows rows) {
  return std::make_unique<BinaryPly>(std::move(file), header, std::move(rows));
}

}  // namespace lamina

// What the readers of line-by-line formats share: how lines end, what a comment is, and where the rows lie.
#pragma once
#include <cstdint>
#include <string_view>
#include <vector>

#include "points/input_file.h"
#include "points/line_reader.h"

namespace lamina {

/// '\n' (also for CRLF), or '\r' for files of the old Macintosh.
char line_end_of(const InputFile& file);

inline bool is_comment(std::string_view line) {
  const std::size_t at = line.find_first_not_of(" \t");
  return at != std::string_view::npos && (line[at] == '#' || line.substr(at).starts_with("//"));
}

/// The places of every few thousandth row, so that reading can begin near any row.
class RowIndex {
 public:
  /// The last line that `lines` gave is the next row.
  void add(const LineReader& lines) {
    if (count_ % kStep == 0) marks_.push_back({lines.line_offset(), lines.line() - 1});
    ++count_;
  }
  [[nodiscard]] std::uint64_t count() const { return count_; }

  /// A reader placed before row first_row_near(row), row < count().
  [[nodiscard]] LineReader near(const InputFile& file, char line_end, std::uint64_t row) const {
    const Mark& mark = marks_[static_cast<std::size_t>(row / kStep)];
    return {file, mark.offset, mark.lines, line_end};
  }
  static std::uint64_t first_row_near(std::uint64_t row) { return row / kStep * kStep; }

 private:
  static constexpr std::uint64_t kStep = 1 << 12;
  struct Mark {
    std::uint64_t offset, lines;
  };
  std::vector<Mark> marks_;
  std::uint64_t count_ = 0;
};

/// Gives rows [first, first + count) of the index to `use(line, line number, i)`, i counting from 0; `is_row(line)`
/// tells the lines that were added to the index from others. Throws Error(unreadable) when the file has become shorter.
template <class IsRow, class Use>
void for_rows(const InputFile& file, char line_end, const RowIndex& index, std::uint64_t first, std::size_t count,
              const IsRow& is_row, const Use& use);

[[noreturn]] void report_vanished_rows(const InputFile& file, std::uint64_t line);

template <class IsRow, class Use>
void for_rows(const InputFile& file, char line_end, const RowIndex& index, std::uint64_t first, std::size_t count,
              const IsRow& is_row, const Use& use) {
  if (count == 0) return;
  LineReader lines = index.near(file, line_end, first);
  std::uint64_t row = RowIndex::first_row_near(first);
  std::string_view line;
  for (const std::uint64_t end = first + count; row < end;) {
    if (!lines.next(line)) report_vanished_rows(file, lines.line());
    if (!is_row(line)) continue;
    if (row >= first) use(line, lines.line(), static_cast<std::size_t>(row - first));
    ++row;
  }
}

}  // namespace lamina

// Text by lines: reading them, where the rows lie among them, and the numbers of a row.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/number.h"
#include "points/input_file.h"
#include "points/point_columns.h"

namespace lamina {

/// What editors of some systems put before text in UTF-8.
inline constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

/// Lines of a file, through a bounded buffer, with their numbers.
class LineReader {
 public:
  /// Begins at `offset`, after `lines` lines; lines end with `line_end`. A byte order mark at the file's
  /// beginning is no part of the first.
  LineReader(const InputFile& file, std::uint64_t offset, std::uint64_t lines, char line_end);

  /// The next line that is not blank, without its end; valid until the next call. False at the end of the file.
  /// Throws Error(unreadable) for a line beyond 64 MB.
  bool next(std::string_view& line);

  /// Number of the last line given, the file's first being 1; at the end of the file that of its last line.
  [[nodiscard]] std::uint64_t line() const { return line_; }
  /// Where in the file the last line given begins.
  [[nodiscard]] std::uint64_t line_offset() const { return line_offset_; }

 private:
  bool next_of_any_kind(std::string_view& line);
  bool refill();

  const InputFile* file_;
  std::uint64_t offset_;  ///< of the bytes after the buffered ones
  std::uint64_t line_;
  std::uint64_t line_offset_ = 0;
  char line_end_;
  std::vector<char> buffer_;
  std::size_t begin_ = 0, end_ = 0;  ///< unread part of the buffer
};

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

/// Throws Error(unreadable) "FILE, line N: WHAT".
[[noreturn]] void fail_at(const InputFile& file, std::uint64_t line, const std::string& what);

/// Throws that the file has become shorter since it was opened; `line`: its last one now.
[[noreturn]] void report_vanished_rows(const InputFile& file, std::uint64_t line);

/// Gives the rows of the index to `use(line, line number, i)`, i counting from 0; `is_row(line)` tells the lines that
/// were added to the index from others. Throws Error(unreadable) when the file has become shorter.
template <class IsRow, class Use>
void for_rows(const InputFile& file, char line_end, const RowIndex& index, RowRange range, const IsRow& is_row,
              const Use& use) {
  if (range.count == 0) return;
  LineReader lines = index.near(file, line_end, range.first);
  std::uint64_t row = RowIndex::first_row_near(range.first);
  std::string_view line;
  for (const std::uint64_t end = range.first + range.count; row < end;) {
    if (!lines.next(line)) report_vanished_rows(file, lines.line());
    if (!is_row(line)) continue;
    if (row >= range.first) use(line, lines.line(), static_cast<std::size_t>(row - range.first));
    ++row;
  }
}

/// How the numbers of a line are kept apart: blanks, or one mark with blanks around it.
inline constexpr char kBlanks = ' ';

/// Cuts a line at its separators; blanks and quotes around words are no part of them. With a mark, words may be empty.
void split_line(std::string_view line, char separator, std::vector<std::string_view>& words);

/// Rows that all have the same columns.
class RowParser {
 public:
  /// `remedy` ends the message about a value outside its column's range.
  RowParser(std::vector<PointColumn> columns, char separator, std::string remedy);
  [[nodiscard]] const std::vector<PointColumn>& columns() const { return columns_; }

  /// Row `at` of the targets. Throws Error(unreadable) naming the file and the line.
  void parse(const InputFile& file, std::string_view line, std::uint64_t line_number, std::size_t at,
             const std::vector<ColumnTarget>& targets) const;

 private:
  class Cursor;
  double take_value(Cursor& cursor, std::size_t column) const;

  std::vector<PointColumn> columns_;
  std::vector<ScalarRange> ranges_;
  char separator_;
  std::string remedy_;
};

// A look at a few thousand rows of a text cloud.

struct TextSample {
  char separator = ' ';
  bool ends_open = false;       ///< the last value of every row is empty: may be none, but a separator behind the last
  bool counted = false;         ///< the first line that is no comment is a lone number
  std::uint64_t top_lines = 0;  ///< lines up to and with the line of names
  std::vector<std::string> names;           ///< of a header line, usual_name()s; empty when there is none
  std::size_t columns = 0;                  ///< words on every row
  std::vector<std::vector<double>> values;  ///< rows looked at; NaN where no number stands
  std::vector<bool> is_word;                ///< per column: something that is no number stands there
  std::vector<bool> is_whole;               ///< per column: digits only
  std::vector<bool> is_long;  ///< per column: has numbers that a float would tell from others too coarsely
  bool long_numbers = false;  ///< a coordinate with more digits than a float holds
};

/// Throws as understand_text does. With `named`, the user names the columns: a first line of words is passed over.
TextSample sample_text(const InputFile& file, char line_end, bool named);

}  // namespace lamina

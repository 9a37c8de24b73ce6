// Lines of a text file, through a bounded buffer, with their numbers.
#pragma once
#include <cstdint>
#include <string_view>
#include <vector>

#include "points/input_file.h"

namespace lamina {

/// What editors of some systems put before text in UTF-8.
inline constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

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

}  // namespace lamina

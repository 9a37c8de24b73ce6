// One line of numbers into the arrays of a batch.
#pragma once
#include <string_view>
#include <vector>

#include "points/input_file.h"
#include "points/point_columns.h"

namespace lamina {

/// How the numbers of a line are kept apart: blanks, or one mark with blanks around it.
inline constexpr char kBlanks = ' ';

/// Cuts a line at its separators; blanks and quotes around words are no part of them. With a mark, words may be empty.
void split_line(std::string_view line, char separator, std::vector<std::string_view>& words);

/// Values that a column can hold, by its type: integers within their range, anything otherwise. Colours given as floats
/// lie between 0 and 1.
struct ValueRange {
  double low, high;
  bool whole;
};
ValueRange value_range(const PointColumn& column);

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
  std::vector<PointColumn> columns_;
  std::vector<ValueRange> ranges_;
  char separator_;
  std::string remedy_;
};

}  // namespace lamina

// What the columns of a text cloud mean: told by the user, by a header line, or by the numbers.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "points/input_file.h"
#include "points/point_columns.h"

namespace lamina {

struct TextLayout {
  std::vector<PointColumn> columns;
  char separator = ' ';         ///< kBlanks, ',' or ';'
  bool counted = false;         ///< rows come in blocks that begin with their number, as in PTS
  std::uint64_t top_lines = 0;  ///< lines before the first row or count, which are not to be read as such
};

/// Throws Error(usage) for PointSettings::columns that cannot be meant.
void require_columns(const std::string& told);

/// Looks at rows from the beginning, the middle and the end of the file. Fills in `info`'s layout and remarks.
/// Throws Error(unreadable) naming the line: nothing but comments, rows of different lengths, words, decimal commas, no
/// x y z; Error(usage) for `told` (PointSettings::columns) that cannot be meant.
TextLayout understand_text(const InputFile& file, char line_end, const std::string& told, PointSourceInfo& info);

}  // namespace lamina

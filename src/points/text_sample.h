// A look at a few thousand rows of a text cloud.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "points/input_file.h"

namespace lamina {

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

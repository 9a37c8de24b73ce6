#include "points/text_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>

#include "lamina/file_ending.h"
#include "base/ply_type.h"
#include "lamina/error.h"
#include "points/row_parser.h"
#include "points/text_sample.h"

namespace lamina {
namespace {

constexpr std::string_view kSkip = "-";

struct Told {
  std::string name;
  std::optional<ScalarType> type;
};

std::vector<Told> parse_told(const std::string& told) {
  const auto refuse = [&](const std::string& what) {
    throw Error(ExitCode::usage,
                fmt::format("--columns {}: {}; write names such as x,y,z,red,green,blue,-", quoted_word(told), what));
  };
  std::vector<Told> columns;
  std::vector<std::string_view> words;
  split_line(told, ',', words);
  for (const std::string_view word : words) {
    const std::size_t colon = word.find(':');
    Told column{usual_name(word.substr(0, colon)), std::nullopt};
    if (column.name.empty()) refuse("an empty name");
    if (colon != std::string_view::npos) {
      column.type = ply_type(word.substr(colon + 1));
      if (!column.type)
        refuse(fmt::format("{} is no type; char uchar short ushort int uint float double are",
                           quoted_word(word.substr(colon + 1))));
    }
    columns.push_back(std::move(column));
  }
  for (const char* axis : {"x", "y", "z"}) {
    if (std::none_of(columns.begin(), columns.end(), [&](const Told& c) { return c.name == axis; })) {
      refuse(fmt::format("no {}", axis));
    }
  }
  return columns;
}

/// What kind of triple columns [at, at + 3) are, going by the rows looked at.
enum class Triple { none, normal, whole_colour, unit_colour };

Triple kind_of_triple(const TextSample& sample, std::size_t at) {
  constexpr double kNearlyOne = 0.02;
  std::size_t unit = 0;
  std::size_t rows = 0;
  bool whole = sample.is_whole[at] && sample.is_whole[at + 1] && sample.is_whole[at + 2];
  double low = 0;
  double high = 0;
  for (const std::vector<double>& row : sample.values) {
    const double length = std::hypot(row[at], row[at + 1], row[at + 2]);
    if (!std::isfinite(length) || length == 0) continue;
    ++rows;
    unit += std::abs(length - 1) < kNearlyOne ? 1 : 0;
    for (std::size_t k = at; k < at + 3; ++k) {
      low = std::min(low, row[k]);
      high = std::max(high, row[k]);
    }
  }
  if (rows == 0 || low < -1.1) return Triple::none;
  if (unit * 10 >= rows * 9) return Triple::normal;
  if (low < 0) return Triple::none;
  if (whole && high > 1 && high < 65536) return Triple::whole_colour;
  return !whole && high <= 1 ? Triple::unit_colour : Triple::none;
}

/// Whether the first column numbers the points: it counts by one, before coordinates that are no whole numbers.
bool is_numbered(const TextSample& sample) {
  constexpr std::size_t kLeastRows = 3;
  constexpr std::size_t kHead = 100;  // rows further on may come from elsewhere in the file
  if (sample.columns < 4 || sample.values.size() < kLeastRows || !sample.is_whole[0]) return false;
  if (sample.is_whole[1] || sample.is_whole[2] || sample.is_whole[3]) return false;
  for (std::size_t i = 1; i < std::min(kHead, sample.values.size()); ++i)
    if (sample.values[i][0] != sample.values[i - 1][0] + 1) return false;
  return true;
}

/// What Open3D's endings say of the columns behind x y z.
Triple kind_of_ending(const std::string& file) {
  const std::string ending = packed_ending(file);
  return ending == ".xyzn" ? Triple::normal : ending == ".xyzrgb" ? Triple::unit_colour : Triple::none;
}

/// Names for columns that nobody has named.
std::vector<std::string> guess_names(const TextSample& sample, const std::string& file) {
  std::vector<std::string> names{"x", "y", "z"};
  if (is_numbered(sample)) names.insert(names.begin(), std::string(kSkip));
  const std::size_t first = names.size();
  const Triple told = sample.columns == 6 ? kind_of_ending(file) : Triple::none;
  bool normals = false;
  bool colours = false;
  bool intensity = false;
  std::size_t others = 0;
  // Leica's order, with an intensity that may look like a colour.
  const bool intensity_first = sample.columns == first + 4 &&
                               kind_of_triple(sample, first + 1) == Triple::whole_colour &&
                               (sample.counted || kind_of_triple(sample, first) != Triple::whole_colour);
  for (std::size_t c = first; c < sample.columns;) {
    const bool three = c + 3 <= sample.columns && !(intensity_first && c == first);
    const Triple kind = !three ? Triple::none : told != Triple::none ? told : kind_of_triple(sample, c);
    if (kind == Triple::normal && !normals) {
      names.insert(names.end(), {"nx", "ny", "nz"});
      normals = true;
      c += 3;
    } else if ((kind == Triple::whole_colour || kind == Triple::unit_colour) && !colours) {
      names.insert(names.end(), {"red", "green", "blue"});
      colours = true;
      c += 3;
    } else {
      names.push_back(!intensity ? "intensity" : fmt::format("value{}", ++others));
      intensity = true;
      ++c;
    }
  }
  return names;
}

/// Colours share one type, the narrowest that all of them fit.
ScalarType colour_type(const TextSample& sample, const std::vector<PointColumn>& columns) {
  bool whole = true;
  double high = 0;
  for (std::size_t c = 0; c < columns.size(); ++c) {
    if (!is_colour(columns[c].name) || columns[c].role == Role::skipped) continue;
    whole = whole && sample.is_whole[c];
    for (const std::vector<double>& row : sample.values) high = std::max(high, row[c]);
  }
  // Whole numbers up to 1 are floats that happen to be 0 or 1; all black is black in any type.
  if (high <= 1 && (!whole || high == 1)) return ScalarType::float32;
  return high <= 255 ? ScalarType::uint8 : ScalarType::uint16;
}

std::string list_of(const std::vector<PointColumn>& columns) {
  std::string text;
  for (const PointColumn& column : columns) {
    text += text.empty() ? "" : ",";
    text += column.role == Role::skipped ? std::string(kSkip) : column.name;
    if (is_colour(column.name)) text += fmt::format(":{}", ply_name(column.type));
  }
  return text;
}

}  // namespace

void require_columns(const std::string& told) {
  if (!told.empty()) parse_told(told);
}

TextLayout understand_text(const InputFile& file, char line_end, const std::string& told, PointSourceInfo& info) {
  const std::vector<Told> wanted = told.empty() ? std::vector<Told>{} : parse_told(told);
  TextSample sample = sample_text(file, line_end, !wanted.empty());
  const std::size_t named = wanted.empty() ? sample.names.size() : wanted.size();
  if (sample.ends_open && named != sample.columns) --sample.columns;
  if (sample.columns < 3) {
    throw Error(ExitCode::unreadable, fmt::format("{}: {} on a row; points need x y z", file.name,
                                                  sample.columns == 1 ? "one value" : "two values"));
  }
  if (named != 0 && named != sample.columns) {
    throw Error(wanted.empty() ? ExitCode::unreadable : ExitCode::usage,
                fmt::format("{}: {} columns are named{}, the rows have {}; name all of them, - for those to skip",
                            file.name, named, wanted.empty() ? " in its header line" : "", sample.columns));
  }
  TextLayout layout;
  layout.separator = sample.separator;
  layout.counted = sample.counted;
  layout.top_lines = sample.top_lines;
  const bool guessed = named == 0;
  const std::vector<std::string> guesses = guessed ? guess_names(sample, file.name) : std::vector<std::string>{};
  for (std::size_t c = 0; c < sample.columns; ++c) {
    PointColumn column;
    column.name = guessed ? guesses[c] : !wanted.empty() ? wanted[c].name : sample.names[c];
    const bool axis = column.name == "x" || column.name == "y" || column.name == "z";
    const bool words = wanted.empty() && sample.is_word[c] && !axis;
    if (words || column.name == kSkip || column.name.empty()) column.role = Role::skipped;
    const auto is_same = [&](const PointColumn& other) {
      return other.role != Role::skipped && other.name == column.name;
    };
    if (wanted.empty() && column.role != Role::skipped &&
        std::any_of(layout.columns.begin(), layout.columns.end(), is_same)) {
      // CloudCompare writes normals twice when they are scalar fields as well.
      column.role = Role::skipped;
      info.remarks.push_back(fmt::format("{}: the second column {} is left out; --columns tells otherwise", file.name,
                                         quoted_word(column.name)));
    }
    if (words && !guessed && !column.name.empty())
      info.remarks.push_back(fmt::format("{}: column {} is left out: it holds words, or nothing in places", file.name,
                                         quoted_word(column.name)));
    layout.columns.push_back(std::move(column));
  }
  const ScalarType colours = colour_type(sample, layout.columns);
  for (std::size_t c = 0; c < layout.columns.size(); ++c) {
    PointColumn& column = layout.columns[c];
    if (sample.is_long[c]) column.type = ScalarType::float64;
    if (is_colour(column.name)) column.type = colours;
    if (column.name == "x" || column.name == "y" || column.name == "z") {
      column.type = sample.long_numbers ? ScalarType::float64 : ScalarType::float32;
    }
    if (!wanted.empty() && wanted[c].type) column.type = *wanted[c].type;
  }
  give_roles(layout.columns, info, file.name, "column");
  if (guessed && sample.columns > 3) {
    info.remarks.push_back(
        fmt::format("{}: columns taken as {}; --columns tells otherwise", file.name, list_of(layout.columns)));
  }
  return layout;
}

}  // namespace lamina

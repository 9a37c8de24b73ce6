#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>

#include "base/number.h"
#include "lamina/error.h"
#include "lamina/file_ending.h"
#include "points/formats.h"
#include "points/point_columns.h"
#include "points/text_rows.h"

namespace lamina {
namespace {

constexpr std::string_view kSkip = "-";

struct TextLayout {
  std::vector<PointColumn> columns;
  char separator = ' ';         ///< kBlanks, ',' or ';'
  bool counted = false;         ///< rows come in blocks that begin with their number, as in PTS
  std::uint64_t top_lines = 0;  ///< lines before the first row or count, which are not to be read as such
};

/// A column as the user names it.
struct NamedColumn {
  std::string name;
  std::optional<ScalarType> type;
};

std::vector<NamedColumn> parse_columns(const std::string& text) {
  const auto refuse = [&](const std::string& what) {
    throw Error(ExitCode::usage,
                fmt::format("--columns {}: {}; write names such as x,y,z,red,green,blue,-", quoted_word(text), what));
  };
  std::vector<NamedColumn> columns;
  std::vector<std::string_view> words;
  split_line(text, ',', words);
  for (const std::string_view word : words) {
    const std::size_t colon = word.find(':');
    NamedColumn column{usual_name(word.substr(0, colon)), std::nullopt};
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
    if (std::none_of(columns.begin(), columns.end(), [&](const NamedColumn& c) { return c.name == axis; })) {
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
  const Triple by_ending = sample.columns == 6 ? kind_of_ending(file) : Triple::none;
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
    const Triple kind = !three ? Triple::none : by_ending != Triple::none ? by_ending : kind_of_triple(sample, c);
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

/// Columns that everybody agrees about: as many as the rows have, three at least.
void require_agreement(const InputFile& file, const std::vector<NamedColumn>& wanted, TextSample& sample) {
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
}

/// Columns that nobody asked for by name and that hold words, or are there already, are left out; remarks say so.
void skip_useless(const InputFile& file, const TextSample& sample, std::vector<PointColumn>& columns,
                  PointSourceInfo& info) {
  for (std::size_t c = 0; c < columns.size(); ++c) {
    PointColumn& column = columns[c];
    const bool axis = column.name == "x" || column.name == "y" || column.name == "z";
    const bool words = sample.is_word[c] && !axis;
    if (words) column.role = Role::skipped;
    const auto is_same = [&](const PointColumn& other) {
      return other.role != Role::skipped && other.name == column.name;
    };
    const auto here = columns.begin() + static_cast<std::ptrdiff_t>(c);
    if (column.role != Role::skipped && std::any_of(columns.begin(), here, is_same)) {
      // CloudCompare writes normals twice when they are scalar fields as well.
      column.role = Role::skipped;
      info.remarks.push_back(fmt::format("{}: the second column {} is left out; --columns tells otherwise", file.name,
                                         quoted_word(column.name)));
    }
    if (words && !sample.names.empty() && !column.name.empty())
      info.remarks.push_back(fmt::format("{}: column {} is left out: it holds words, or nothing in places", file.name,
                                         quoted_word(column.name)));
  }
}

/// Types by the numbers looked at, unless the user names them.
void give_types(const TextSample& sample, const std::vector<NamedColumn>& wanted, std::vector<PointColumn>& columns) {
  const ScalarType colours = colour_type(sample, columns);
  for (std::size_t c = 0; c < columns.size(); ++c) {
    PointColumn& column = columns[c];
    if (sample.is_long[c]) column.type = ScalarType::float64;
    if (is_colour(column.name)) column.type = colours;
    if (column.name == "x" || column.name == "y" || column.name == "z") {
      column.type = sample.long_numbers ? ScalarType::float64 : ScalarType::float32;
    }
    if (!wanted.empty() && wanted[c].type) column.type = *wanted[c].type;
  }
}

/// Looks at rows from the beginning, the middle and the end of the file. Fills in `info`'s layout and remarks.
/// Throws Error(unreadable) naming the line: nothing but comments, rows of different lengths, words, decimal commas, no
/// x y z; Error(usage) for `named` (PointSettings::columns) that cannot be meant.
TextLayout understand_text(const InputFile& file, char line_end, const std::string& named, PointSourceInfo& info) {
  const std::vector<NamedColumn> wanted = named.empty() ? std::vector<NamedColumn>{} : parse_columns(named);
  TextSample sample = sample_text(file, line_end, !wanted.empty());
  require_agreement(file, wanted, sample);
  const bool guessed = wanted.empty() && sample.names.empty();
  const std::vector<std::string> guesses = guessed ? guess_names(sample, file.name) : std::vector<std::string>{};
  TextLayout layout;
  layout.separator = sample.separator;
  layout.counted = sample.counted;
  layout.top_lines = sample.top_lines;
  for (std::size_t c = 0; c < sample.columns; ++c) {
    PointColumn column;
    column.name = guessed ? guesses[c] : !wanted.empty() ? wanted[c].name : sample.names[c];
    if (column.name == kSkip || column.name.empty()) column.role = Role::skipped;
    layout.columns.push_back(std::move(column));
  }
  if (wanted.empty()) skip_useless(file, sample, layout.columns, info);
  give_types(sample, wanted, layout.columns);
  give_roles(layout.columns, info, file.name, "column");
  if (guessed && sample.columns > 3) {
    info.remarks.push_back(
        fmt::format("{}: columns taken as {}; --columns tells otherwise", file.name, list_of(layout.columns)));
  }
  return layout;
}

bool is_row(std::string_view line) {
  return !is_comment(line);
}

class TextPoints final : public PointSource {
 public:
  TextPoints(InputFile file, const std::string& path, const std::string& columns)
      : file_(std::move(file)), line_end_(line_end_of(file_)) {
    info_.path = path;
    const TextLayout layout = understand_text(file_, line_end_, columns, info_);
    parser_.emplace(
        layout.columns, layout.separator,
        ", as in the rows looked at before; say what it is with --columns (red:uchar, red:ushort, red:float)");
    count_rows(layout);
    info_.random_access = true;
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    const RowRange rows = rows_there(info_, first, count);
    const std::vector<ColumnTarget> targets = prepare_batch(info_, parser_->columns(), rows, out);
    std::size_t done = 0;
    auto block = std::upper_bound(blocks_.begin(), blocks_.end(), rows.first,
                                  [](std::uint64_t row, const Block& b) { return row < b.first; });
    for (--block; done < rows.count; ++block) {
      const std::uint64_t begin = rows.first + done - block->first;
      const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(rows.count - done, block->rows.count() - begin));
      for_rows(file_, line_end_, block->rows, {begin, n}, is_row,
               [&](std::string_view line, std::uint64_t number, std::size_t i) {
                 parser_->parse(file_, line, number, done + i, targets);
               });
      done += n;
    }
    round_exact_attributes(out);
  }

 private:
  /// Rows behind a count, or all of them.
  struct Block {
    std::uint64_t first = 0;
    RowIndex rows;
  };

  [[nodiscard]] std::uint64_t parse_count(std::string_view line, std::uint64_t number) const {
    std::vector<std::string_view> words;
    split_line(line, kBlanks, words);
    const std::optional<std::uint64_t> count = parse_whole(words[0]);
    if (!count || words.size() != 1) {
      throw Error(
          ExitCode::unreadable,
          fmt::format("{}, line {}: the number of rows of the next scan expected, {} stands there; put it right "
                      "or delete all such numbers",
                      file_.name, number, quoted_word(line)));
    }
    return *count;
  }

  void count_rows(const TextLayout& layout) {
    LineReader lines(file_, 0, 0, line_end_);
    std::string_view line;
    std::uint64_t left = 0;  // rows of the block
    if (!layout.counted) blocks_.emplace_back();
    while (lines.next(line)) {
      if (lines.line() <= layout.top_lines || is_comment(line)) continue;
      if (layout.counted && left == 0) {
        left = parse_count(line, lines.line());
        if (left > 0) blocks_.push_back({info_.count, {}});
        continue;
      }
      blocks_.back().rows.add(lines);
      ++info_.count;
      --left;
    }
    if (layout.counted && left > 0) {
      throw Error(
          ExitCode::unreadable,
          fmt::format("{}: {} more rows promised when it ends at line {}: it was cut short, or a number of rows is "
                      "wrong",
                      file_.name, left, lines.line()));
    }
    if (blocks_.empty()) blocks_.emplace_back();
  }

  InputFile file_;
  char line_end_;
  std::optional<RowParser> parser_;
  std::vector<Block> blocks_;
};

}  // namespace

void require_columns(const std::string& columns) {
  if (!columns.empty()) parse_columns(columns);
}

std::unique_ptr<PointSource> open_text(InputFile file, const std::string& path, const std::string& columns) {
  return std::make_unique<TextPoints>(std::move(file), path, columns);
}

}  // namespace lamina

#include "points/text_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <string_view>

#include "base/number.h"
#include "lamina/error.h"
#include "points/point_columns.h"

namespace lamina {
namespace {

constexpr std::size_t kHeadRows = 1000;
constexpr std::size_t kOtherRows = 500;
constexpr std::size_t kMostColumns = 256;
constexpr std::uint64_t kOtherBytes = 64 << 10;

struct Row {
  std::string text;
  std::uint64_t line = 0;
};

std::string_view without_mark(std::string_view line) {
  const std::size_t at = line.find_first_not_of("#/ \t");
  return at == std::string_view::npos ? std::string_view{} : line.substr(at);
}

/// A line of names has x, y and z among them; the separator is its own. With any but blanks names may be of more words.
std::vector<std::string> names_on(std::string_view line) {
  std::vector<std::string_view> words;
  for (const char separator : {';', ',', '\t', kBlanks}) {
    split_line(without_mark(line), separator, words);
    while (!words.empty() && words.back().empty()) words.pop_back();
    if (std::vector<std::string> names = names_with_positions(words); !names.empty()) return names;
  }
  return {};
}

bool begins_with_number(std::string_view line) {
  std::vector<std::string_view> words;
  for (const char separator : {kBlanks, ',', ';'}) {
    split_line(line, separator, words);
    if (!words.empty() && is_number(words[0])) return true;
  }
  return false;
}

/// The words of a line whatever separates them.
std::vector<std::string_view> words_of(std::string& line) {
  std::replace_if(
      line.begin(), line.end(), [](char c) { return c == ',' || c == ';'; }, ' ');
  std::vector<std::string_view> words;
  split_line(line, kBlanks, words);
  return words;
}

bool has_position(const std::vector<std::string_view>& words) {
  return std::count_if(words.begin(), words.end(), [](std::string_view w) { return is_number(w); }) >= 3;
}

/// Rows from the beginning; finds the header line and the count on the way.
std::vector<Row> head_rows(const InputFile& file, char line_end, bool named, TextSample& sample) {
  std::vector<Row> rows;
  LineReader lines(file, 0, 0, line_end);
  std::string_view line;
  while (rows.size() < kHeadRows && lines.next(line)) {
    const bool comment = is_comment(line);
    if (rows.empty() && !sample.counted && (comment || !begins_with_number(line))) {
      if (std::vector<std::string> names = names_on(line); !names.empty()) {
        sample.names = std::move(names);
        sample.top_lines = lines.line();
        continue;
      }
      // A row may begin with a word: "Station1 1 2 3".
      std::string copy(line);
      if (named && !comment && sample.top_lines == 0 && !has_position(words_of(copy))) {
        sample.top_lines = lines.line();
        continue;
      }
    }
    if (comment) continue;
    double count = 0;
    if (rows.empty() && !sample.counted &&
        is_number(without_mark(line.substr(0, line.find_last_not_of(" \t\r") + 1)), count)) {
      sample.counted = true;
      continue;
    }
    rows.push_back({std::string(line), lines.line()});
  }
  return rows;
}

/// Decimal commas would make two numbers of one without anybody noticing.
char separator_of(const InputFile& file, const std::vector<Row>& rows) {
  bool semicolon = false;
  bool comma = false;
  bool comma_in_number = false;
  bool lone_blank = false;
  for (const Row& row : rows) {
    const std::string_view line = row.text;
    bool quoted = false;
    for (std::size_t i = 0; i < line.size(); ++i) {
      quoted = quoted != (line[i] == '"');
      if (quoted) continue;
      const char before = i == 0 ? ' ' : line[i - 1];
      const char after = i + 1 == line.size() ? ' ' : line[i + 1];
      semicolon = semicolon || line[i] == ';';
      comma = comma || line[i] == ',';
      const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
      comma_in_number = comma_in_number || (line[i] == ',' && is_digit(before) && is_digit(after));
      lone_blank = lone_blank || (is_space(line[i]) && is_digit(before) && (is_digit(after) || after == '-'));
    }
    if (comma_in_number && (semicolon || lone_blank)) {
      fail_at(file, row.line, "the commas look like decimal commas; write numbers with a decimal point");
    }
  }
  return semicolon ? ';' : comma ? ',' : kBlanks;
}

/// Prose is told from points by its first line.
void require_numbers(const InputFile& file, const Row& row) {
  std::string line = row.text;
  const std::vector<std::string_view> words = words_of(line);
  if (has_position(words)) return;
  const auto has = [&](std::initializer_list<std::string_view> names) {
    return std::any_of(words.begin(), words.end(), [&](std::string_view word) {
      return std::find(names.begin(), names.end(), usual_name(word)) != names.end();
    });
  };
  if (has({"lat", "latitude"}) && has({"lon", "long", "longitude"}))
    fail_at(file, row.line,
            "longitude and latitude are degrees; project them to metres first, for example with PDAL or QGIS");
  fail_at(file, row.line,
          fmt::format("{} is no row of numbers; points need x y z; where it names the columns, name them in its place: "
                      "--columns x,y,z,...",
                      quoted_word(row.text)));
}

bool has_many_digits(std::string_view word) {
  constexpr long kFloatDigits = 8;
  return std::count_if(word.begin(), word.end(), [](char c) { return c >= '0' && c <= '9'; }) > kFloatDigits;
}

void take_row(const std::vector<std::string_view>& words, TextSample& sample) {
  // From here on floats are more than 0.007 apart: a clock's digits, not a measurement's.
  constexpr double kCoarse = 1 << 16;
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::vector<double>& row = sample.values.emplace_back(words.size(), kNone);
  for (std::size_t c = 0; c < words.size(); ++c) {
    if (!is_number(words[c], row[c])) {
      sample.is_word[c] = true;
      row[c] = kNone;
    }
    const bool whole = !words[c].empty() && words[c].find_first_not_of("0123456789+-") == std::string_view::npos;
    sample.is_whole[c] = sample.is_whole[c] && whole;
    const bool many_digits = has_many_digits(words[c]);
    sample.long_numbers = sample.long_numbers || many_digits;
    sample.is_long[c] = sample.is_long[c] || (many_digits && std::abs(row[c]) >= kCoarse);
  }
}

/// Rows after `offset`, where a line has begun; what does not look like the head's rows is for the reader to judge.
void take_others(const InputFile& file, char line_end, std::uint64_t offset, TextSample& sample) {
  LineReader lines(file, offset, 0, line_end);
  std::string_view line;
  std::vector<std::string_view> words;
  lines.next(line);
  for (std::size_t i = 0; i < kOtherRows && lines.next(line); ++i) {
    if (is_comment(line)) continue;
    split_line(line, sample.separator, words);
    if (words.size() == sample.columns) take_row(words, sample);
  }
}

}  // namespace

TextSample sample_text(const InputFile& file, char line_end, bool named) {
  TextSample sample;
  std::vector<Row> rows = head_rows(file, line_end, named, sample);
  if (rows.empty() && !sample.names.empty()) {
    sample.columns = sample.names.size();
    sample.is_word.assign(sample.columns, false);
    sample.is_whole.assign(sample.columns, true);
    sample.is_long.assign(sample.columns, false);
    return sample;
  }
  if (rows.empty()) {
    throw Error(ExitCode::unreadable, fmt::format("{}: holds no rows of numbers", file.name));
  }
  require_numbers(file, rows.front());
  sample.separator = separator_of(file, rows);
  std::vector<std::string_view> words;
  sample.ends_open = true;
  for (const Row& row : rows) {
    split_line(row.text, sample.separator, words);
    if (sample.columns == 0) {
      if (words.size() > kMostColumns) fail_at(file, row.line, fmt::format("more than {} columns", kMostColumns));
      sample.columns = words.size();
      sample.is_word.assign(sample.columns, false);
      sample.is_whole.assign(sample.columns, true);
      sample.is_long.assign(sample.columns, false);
    } else if (words.size() == 1 && sample.counted) {
      continue;  // the next block's count
    } else if (words.size() != sample.columns) {
      fail_at(file, row.line,
              fmt::format("{} values, but {} on line {}; all rows need the same", words.size(), sample.columns,
                          rows.front().line));
    }
    take_row(words, sample);
    sample.ends_open = sample.ends_open && words.back().empty();
  }
  if (file.bytes > 8 * kOtherBytes) {
    take_others(file, line_end, file.bytes / 2, sample);
    take_others(file, line_end, file.bytes - kOtherBytes, sample);
  }
  return sample;
}

}  // namespace lamina

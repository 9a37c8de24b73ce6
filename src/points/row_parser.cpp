#include "points/row_parser.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/ply_type.h"
#include "lamina/error.h"
#include "points/number.h"

namespace lamina {
namespace {

template <class T>
ValueRange range_of() {
  return {static_cast<double>(std::numeric_limits<T>::min()), static_cast<double>(std::numeric_limits<T>::max()), true};
}

constexpr char kQuote = '"';

const char* skip_blanks(const char* p, const char* end) {
  while (p != end && is_space(*p)) ++p;
  return p;
}

/// A number alone or in quotes; returns where it ends, null when it is none.
const char* parse_word(const char* p, const char* end, double& value) {
  if (*p != kQuote) return parse_number(p, end, value);
  const char* stop = parse_number(skip_blanks(p + 1, end), end, value);
  if (stop != nullptr) stop = skip_blanks(stop, end);
  return stop == nullptr || stop == end || *stop != kQuote ? nullptr : stop + 1;
}

/// A quoted word may hold separators.
const char* end_of_word(const char* p, const char* end, char separator) {
  if (p != end && *p == kQuote) {
    const char* closing = std::find(p + 1, end, kQuote);
    p = closing == end ? end : closing + 1;
  }
  while (p != end && *p != separator && !(separator == kBlanks && is_space(*p))) ++p;
  return p;
}

}  // namespace

void split_line(std::string_view line, char separator, std::vector<std::string_view>& words) {
  words.clear();
  const char* p = line.data();
  const char* const end = p + line.size();
  for (p = skip_blanks(p, end); p != end; p = skip_blanks(p, end)) {
    const char* stop = end_of_word(p, end, separator);
    const char* last = stop;
    while (last != p && is_space(last[-1])) --last;
    const bool quoted = last - p >= 2 && *p == kQuote && last[-1] == kQuote;
    words.emplace_back(quoted ? p + 1 : p, static_cast<std::size_t>(last - p - (quoted ? 2 : 0)));
    p = stop;
    if (separator != kBlanks && p != end && ++p == end) words.emplace_back(p, 0);
  }
}

ValueRange value_range(const PointColumn& column) {
  switch (column.type) {
    case ScalarType::int8:
      return range_of<std::int8_t>();
    case ScalarType::uint8:
      return range_of<std::uint8_t>();
    case ScalarType::int16:
      return range_of<std::int16_t>();
    case ScalarType::uint16:
      return range_of<std::uint16_t>();
    case ScalarType::int32:
      return range_of<std::int32_t>();
    case ScalarType::uint32:
      return range_of<std::uint32_t>();
    case ScalarType::float32:
    case ScalarType::float64:
      break;
  }
  if (column.role == Role::attribute && (column.name == "red" || column.name == "green" || column.name == "blue")) {
    return {0, 1, false};
  }
  constexpr double kAll = std::numeric_limits<double>::infinity();
  return {-kAll, kAll, false};
}

RowParser::RowParser(std::vector<PointColumn> columns, char separator, std::string remedy)
    : columns_(std::move(columns)), separator_(separator), remedy_(std::move(remedy)) {
  for (const PointColumn& column : columns_) ranges_.push_back(value_range(column));
}

void RowParser::parse(const InputFile& file, std::string_view line, std::uint64_t line_number, std::size_t at,
                      const std::vector<ColumnTarget>& targets) const {
  const auto fail = [&](const std::string& what) {
    throw Error(ExitCode::unreadable, fmt::format("{}, line {}: {}", file.name, line_number, what));
  };
  const auto word = [&](const char* p, const char* stop) {
    return quoted_word({p, static_cast<std::size_t>(stop - p)});
  };
  const char* p = line.data();
  const char* const end = p + line.size();
  bool more = false;  // a separator stands before, so that there is a value even if it is empty
  for (std::size_t c = 0; c < targets.size(); ++c) {
    p = skip_blanks(p, end);
    const bool wanted = targets[c].wide != nullptr || targets[c].narrow != nullptr;
    if (p == end && (wanted || !more)) {
      fail(fmt::format("{} values expected, only {} stand there ({} is missing)", targets.size(), c,
                       quoted_word(columns_[c].name)));
    }
    if (!wanted) {
      p = end_of_word(p, end, separator_);
    } else {
      double value = 0;
      const char* stop = parse_word(p, end, value);
      if (stop == nullptr || (stop != end && !is_space(*stop) && *stop != separator_)) {
        fail(fmt::format("{} is no number ({} expected)", word(p, end_of_word(p, end, separator_)),
                         quoted_word(columns_[c].name)));
      }
      const ValueRange& range = ranges_[c];
      if (value < range.low || value > range.high || (range.whole && std::isnan(value))) {
        fail(fmt::format("{} is {}, outside {:g} to {:g}{}", quoted_word(columns_[c].name), word(p, stop), range.low,
                         range.high, remedy_));
      }
      if (targets[c].wide != nullptr) {
        targets[c].wide[at] = value;
      } else {
        targets[c].narrow[at] = static_cast<float>(value);
      }
      p = stop;
    }
    if (separator_ != kBlanks) {
      p = skip_blanks(p, end);
      more = p != end && *p == separator_;
      if (more) {
        ++p;
      } else if (p != end) {
        fail(fmt::format("{} stands where a '{}' should", word(p, end_of_word(p, end, kBlanks)), separator_));
      }
    }
  }
  p = skip_blanks(p, end);
  if (p != end) {
    fail(fmt::format("{} values expected, more stand there, from {} on", targets.size(),
                     word(p, end_of_word(p, end, separator_))));
  }
}

}  // namespace lamina

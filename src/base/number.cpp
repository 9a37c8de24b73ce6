#include "base/number.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string_view>

#include "lamina/error.h"
#include "lamina/length.h"

namespace lamina {
namespace {

struct Names {
  ScalarType type;
  std::string_view classic, sized;
};

/// In the order of ScalarType.
constexpr std::array<Names, 8> kNames{{{ScalarType::int8, "char", "int8"},
                                       {ScalarType::uint8, "uchar", "uint8"},
                                       {ScalarType::int16, "short", "int16"},
                                       {ScalarType::uint16, "ushort", "uint16"},
                                       {ScalarType::int32, "int", "int32"},
                                       {ScalarType::uint32, "uint", "uint32"},
                                       {ScalarType::float32, "float", "float32"},
                                       {ScalarType::float64, "double", "float64"}}};

}  // namespace

double load_scalar(ScalarType type, bool swapped, const std::byte* from) {
  return with_scalar_type(type, [=](auto zero) {
    using T = decltype(zero);
    return static_cast<double>(swapped ? load_big<T>(from) : load_little<T>(from));
  });
}

ScalarRange scalar_range(ScalarType type) {
  return with_scalar_type(type, [](auto zero) -> ScalarRange {
    using T = decltype(zero);
    constexpr bool kFloat = std::is_floating_point_v<T>;
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    return {kFloat ? -kInfinity : static_cast<double>(std::numeric_limits<T>::min()),
            kFloat ? kInfinity : static_cast<double>(std::numeric_limits<T>::max())};
  });
}

std::string_view ply_name(ScalarType type) {
  return kNames.at(static_cast<std::size_t>(type)).classic;
}

std::optional<ScalarType> ply_type(std::string_view name) {
  for (const Names& names : kNames) {
    if (name == names.classic || name == names.sized) return names.type;
  }
  return std::nullopt;
}

namespace {

/// The rest of a number whose beginning, [p, stop), was read as `value`: a word for what is no number, or an exponent
/// after D. Returns where it ends; `stop` when it is neither.
const char* parse_rest(const char* p, const char* stop, const char* end, double& value) {
  const auto is_digit = [&](const char* at) { return at != end && *at >= '0' && *at <= '9'; };
  if (*stop == '#') {
    const std::string_view rest(stop + 1, static_cast<std::size_t>(end - stop - 1));
    for (const std::string_view word : {"INF", "QNAN", "SNAN", "IND"}) {
      if (!rest.starts_with(word)) continue;
      value = word == "INF" ? std::copysign(std::numeric_limits<double>::infinity(), value)
                            : std::numeric_limits<double>::quiet_NaN();
      stop += 1 + word.size();
      while (is_digit(stop)) ++stop;
      return stop;
    }
    return stop;
  }
  constexpr std::size_t kLongest = 64;
  const char* last = stop + 1;
  if (last != end && (*last == '+' || *last == '-')) ++last;
  if (!is_digit(last)) return stop;
  while (is_digit(last)) ++last;
  if (last - p > static_cast<std::ptrdiff_t>(kLongest)) return stop;
  std::array<char, kLongest> usual;
  std::copy(p, last, usual.begin());
  usual[static_cast<std::size_t>(stop - p)] = 'e';
  const char* const usual_end = usual.data() + (last - p);
  double whole = 0;
  if (parse_decimal(usual.data(), usual_end, whole) != usual_end) return stop;
  value = whole;
  return last;
}

}  // namespace

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r";
  const auto first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

const char* parse_decimal(const char* p, const char* end, double& value) {
  if (p != end && *p == '+' && p + 1 != end && p[1] != '-') ++p;
  const auto [stop, error] = std::from_chars(p, end, value);
  if (error == std::errc{}) return stop;
  if (error != std::errc::result_out_of_range) return nullptr;
  long double wider = 0;
  const bool huge = std::from_chars(p, end, wider).ec != std::errc{};
  if (huge) {  // beyond even that: the exponent's sign decides
    const std::string_view word(p, static_cast<std::size_t>(stop - p));
    const bool small = word.find("e-") != word.npos || word.find("E-") != word.npos;
    wider = small ? 0.0L : std::numeric_limits<long double>::infinity();
    if (*p == '-') wider = -wider;
  }
  value = static_cast<double>(wider);
  return stop;
}

const char* parse_number(const char* p, const char* end, double& value) {
  const char* const stop = parse_decimal(p, end, value);
  const bool more = stop != nullptr && stop != end && (*stop == '#' || *stop == 'D' || *stop == 'd');
  return more ? parse_rest(p, stop, end, value) : stop;
}

bool is_number(std::string_view word, double& value) {
  const char* const end = word.data() + word.size();
  return !word.empty() && parse_number(word.data(), end, value) == end;
}

bool is_number(std::string_view word) {
  double ignored = 0;
  return is_number(word, ignored);
}

std::optional<double> take_decimal(std::string_view& text) {
  text.remove_prefix(std::min(text.find_first_not_of(" \t"), text.size()));
  double value = 0;
  const char* const stop = parse_decimal(text.data(), text.data() + text.size(), value);
  if (stop == nullptr) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(stop - text.data()));
  return value;
}

std::optional<std::uint64_t> parse_whole(std::string_view word) {
  std::uint64_t value = 0;
  const char* const end = word.data() + word.size();
  const auto [stop, error] = std::from_chars(word.data(), end, value);
  return error == std::errc{} && stop == end ? std::optional(value) : std::nullopt;
}

Length parse_length(std::string_view text) {
  const auto refuse = [&](std::string_view why) {
    throw Error(ExitCode::usage,
                fmt::format("'{}' is not a length: {}; write 0.01 (input units), 0.6r (sample radii) or "
                            "0.9R (influence radii)",
                            text, why));
  };
  Length length;
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, length.value);
  if (error != std::errc{}) refuse(error == std::errc::result_out_of_range ? "number out of range" : "no number");
  if (!std::isfinite(length.value)) refuse("not finite");
  if (length.value < 0 || std::signbit(length.value)) refuse("negative");
  const std::string_view suffix(rest, static_cast<std::size_t>(end - rest));
  if (suffix == "r") {
    length.unit = Length::Unit::sample_radius;
  } else if (suffix == "R") {
    length.unit = Length::Unit::influence_radius;
  } else if (!suffix.empty()) {
    refuse(fmt::format("unknown unit '{}'", suffix));
  }
  return length;
}

std::string to_string(const Length& length) {
  switch (length.unit) {
    case Length::Unit::sample_radius:
      return fmt::format("{}r", length.value);
    case Length::Unit::influence_radius:
      return fmt::format("{}R", length.value);
    case Length::Unit::world:
      break;
  }
  return fmt::format("{}", length.value);
}

double resolve(const Length& length, double sample_radius, double blend) {
  switch (length.unit) {
    case Length::Unit::sample_radius:
      return length.value * sample_radius;
    case Length::Unit::influence_radius:
      return length.value * sample_radius * blend;
    case Length::Unit::world:
      break;
  }
  return length.value;
}

}  // namespace lamina

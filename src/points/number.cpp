#include "points/number.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string_view>

namespace lamina {
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
  if (parse_number(usual.data(), usual_end, whole) != usual_end) return stop;
  value = whole;
  return last;
}

}  // namespace

const char* parse_number(const char* p, const char* end, double& value) {
  if (p != end && *p == '+' && p + 1 != end && p[1] != '-') ++p;
  const auto [stop, error] = std::from_chars(p, end, value);
  if (error == std::errc{}) {
    const bool more = stop != end && (*stop == '#' || *stop == 'D' || *stop == 'd');
    return more ? parse_rest(p, stop, end, value) : stop;
  }
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

}  // namespace lamina

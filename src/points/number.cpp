#include "points/number.h"

#include <charconv>
#include <limits>
#include <string_view>

namespace lamina {

const char* parse_number(const char* p, const char* end, double& value) {
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

}  // namespace lamina

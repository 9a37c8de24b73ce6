#include "lamina/length.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "lamina/error.h"

namespace lamina {

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

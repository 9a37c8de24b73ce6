// Lines of a text format and the numbers in them.
#pragma once
#include <algorithm>
#include <charconv>
#include <cstdint>
#include <istream>
#include <optional>
#include <string>
#include <string_view>

namespace lamina::meshes {

/// Without blanks at either end.
inline std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

/// The number `text` begins with, which moves behind it; infinities and NaN are numbers here.
inline std::optional<double> next_number(std::string_view& text) {
  text.remove_prefix(std::min(text.find_first_not_of(" \t"), text.size()));
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto parsed = std::from_chars(text.data(), text.data() + text.size(), value);
  if (parsed.ec == std::errc::invalid_argument) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(parsed.ptr - text.data()));
  return value;
}

/// Lines that hold something: blanks trimmed, comments (#) cut off, empty ones passed over.
class LineReader {
 public:
  explicit LineReader(std::istream& in) : in_(in) {}
  /// Empty at the end of the file; valid until the next call.
  std::string_view next() {
    while (std::getline(in_, line_)) {
      ++number_;
      line_.resize(std::min(line_.find('#'), line_.size()));
      if (const auto text = trimmed(line_); !text.empty()) return text;
    }
    return {};
  }
  [[nodiscard]] std::uint64_t number() const { return number_; }

 private:
  std::istream& in_;
  std::string line_;
  std::uint64_t number_ = 0;
};

}  // namespace lamina::meshes

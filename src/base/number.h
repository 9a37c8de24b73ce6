// Numbers in text files.
#pragma once
#include <cstdint>
#include <optional>
#include <string_view>

namespace lamina {

/// Blanks within a line.
inline bool is_space(char c) {
  return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f';
}

/// Without blanks at either end.
std::string_view trimmed(std::string_view text);

/// Parses a number at the beginning of [p, end) as double; returns where it ends, null when there is none.
/// Too large becomes infinite, too small zero, as a wider type shows; nan and inf are numbers.
const char* parse_decimal(const char* p, const char* end, double& value);

/// The same, with what only some programs write: 1.#QNAN, -1.#IND and 1.#INF of Microsoft's libraries, and 1.5D+02, as
/// Fortran writes doubles.
const char* parse_number(const char* p, const char* end, double& value);

/// Whether all of the word is a number, as parse_number() reads it, which is then its `value`.
bool is_number(std::string_view word, double& value);
bool is_number(std::string_view word);

/// The decimal number `text` begins with behind blanks; `text` moves behind it.
std::optional<double> take_decimal(std::string_view& text);

/// The whole number of 64 bits, digits only, that is all of the word.
std::optional<std::uint64_t> parse_whole(std::string_view word);

}  // namespace lamina

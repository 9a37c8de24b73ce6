// Numbers in text files.
#pragma once

namespace lamina {

/// Blanks within a line.
inline bool is_space(char c) {
  return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f';
}

/// Parses a number at the beginning of [p, end) as double; returns where it ends, null when there is none.
/// Too large becomes infinite, too small zero, as a wider type shows; nan and inf are numbers, also as Microsoft's
/// libraries wrote them (1.#QNAN, -1.#IND, 1.#INF), and so is 1.5D+02, as Fortran writes doubles.
const char* parse_number(const char* p, const char* end, double& value);

}  // namespace lamina

// Numbers written for people and read from them, and the nearest word to a mistyped one.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace lamina::tools {

std::string count_text(std::uint64_t n);      ///< 950, 12.3 k, 1.23 M
std::string bytes_text(std::uint64_t bytes);  ///< 950 B, 12.3 MB (powers of 1000)
std::string seconds_text(double seconds);     ///< 0.42 s, 12.3 s, 3 min 05 s, 2 h 07 min

/// Bytes from text such as 512M, 4G or 1.5GiB (powers of 1024; a bare number is bytes). Throws Error(usage).
std::size_t parse_bytes(std::string_view text);

/// The candidate within a small edit distance of `word` (insert, delete, replace, swap neighbours); empty when none is
/// near.
std::string nearest_word(std::string_view word, const std::vector<std::string>& candidates);

}  // namespace lamina::tools

// How much readers take from a file at once.
#pragma once
#include <cstddef>

namespace lamina {

#ifndef LAMINA_READ_BYTES
#define LAMINA_READ_BYTES (128 << 10)
#endif

/// What stays in the second-level cache until it is converted. The fuzzers read by fewer (tests/fuzz/CMakeLists.txt),
/// so that lines, rows and headers cross the border of two pieces as often in their small files as in large ones.
inline constexpr std::size_t kReadBytes = LAMINA_READ_BYTES;

}  // namespace lamina

// How much of the heap is in use: for tests of what a job keeps.
#pragma once
#include <malloc.h>

#include <cstddef>
#include <string>

namespace lamina::test {

inline std::size_t heap_bytes() {
  const struct mallinfo2 info = ::mallinfo2();
  return info.uordblks + info.hblkhd;
}

/// False where a sanitizer has its own heap, of which the C library knows nothing.
inline bool heap_is_counted() {
  constexpr std::size_t kProbe = std::size_t{1} << 22;
  const std::size_t before = heap_bytes();
  const std::string probe(kProbe, 'x');
  return heap_bytes() >= before + kProbe && probe.find('y') == std::string::npos;
}

}  // namespace lamina::test

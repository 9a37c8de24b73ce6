#include "e57/crc32c.h"

#include <nmmintrin.h>

#include "base/little_endian.h"

namespace lamina::e57 {

std::uint32_t crc32c(const std::byte* data, std::size_t bytes) {
  std::uint64_t crc = 0xFFFFFFFF;
  for (; bytes >= 8; bytes -= 8, data += 8) crc = _mm_crc32_u64(crc, load_little<std::uint64_t>(data));
  auto narrow = static_cast<std::uint32_t>(crc);
  for (; bytes > 0; --bytes, ++data) narrow = _mm_crc32_u8(narrow, std::to_integer<unsigned char>(*data));
  return ~narrow;
}

}  // namespace lamina::e57

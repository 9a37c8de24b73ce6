#include "vdb/content_tag.h"

#include <fmt/format.h>

#include <bit>
#include <cstring>

namespace lamina::volume {

void ContentTag::mix(std::uint64_t word) {
  // Two sums in the manner of FNV-1a, of eight bytes at a time; turning brings high bits to where they count.
  constexpr std::uint64_t kPrime = 0x100000001b3ULL, kOther = 0x9e3779b97f4a7c15ULL;
  a_ = std::rotl((a_ ^ word) * kPrime, 29);
  b_ = std::rotl((b_ ^ ~word) * kOther, 31);
}

void ContentTag::add(std::string_view bytes) {
  std::size_t i = 0;
  const auto add_byte = [&] {
    const std::uint64_t place = length_++ % 8;
    word_ |= std::uint64_t{static_cast<std::uint8_t>(bytes[i++])} << (8 * place);
    if (place < 7) return;
    mix(word_);
    word_ = 0;
  };
  while (i < bytes.size() && length_ % 8 != 0) add_byte();
  for (; i + 8 <= bytes.size(); i += 8, length_ += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + i, sizeof word);
    mix(word);
  }
  while (i < bytes.size()) add_byte();
}

std::string ContentTag::text() const {
  ContentTag end = *this;
  end.mix(word_);
  end.mix(length_);
  const std::uint64_t a = end.a_, b = end.b_;
  // Version 8 of RFC 9562: the maker's own scheme.
  return fmt::format("{:08x}-{:04x}-8{:03x}-a{:03x}-{:012x}", a >> 32, (a >> 16) & 0xFFFF, a & 0xFFF, b >> 52,
                     b & 0xFFFFFFFFFFFFULL);
}

}  // namespace lamina::volume

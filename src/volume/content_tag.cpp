#include "volume/content_tag.h"

#include <fmt/format.h>

namespace lamina::volume {

void ContentTag::add(std::string_view bytes) {
  // FNV-1a, 64 bits, and a second one that sees each byte turned round.
  for (const char c : bytes) {
    const auto byte = static_cast<std::uint8_t>(c);
    a_ = (a_ ^ byte) * 0x100000001b3ULL;
    b_ = (b_ ^ static_cast<std::uint8_t>(~byte)) * 0x100000001b3ULL;
  }
}

std::string ContentTag::text() const {
  // Version 8 of RFC 9562: the maker's own scheme.
  return fmt::format("{:08x}-{:04x}-8{:03x}-a{:03x}-{:012x}", a_ >> 32, (a_ >> 16) & 0xFFFF, a_ & 0xFFF, b_ >> 52,
                     b_ & 0xFFFFFFFFFFFFULL);
}

}  // namespace lamina::volume

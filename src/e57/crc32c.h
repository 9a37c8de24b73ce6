// CRC-32C, the checksum of E57's pages.
#pragma once
#include <cstddef>
#include <cstdint>

namespace lamina::e57 {

/// Castagnoli's polynomial, as iSCSI has it.
std::uint32_t crc32c(const std::byte* data, std::size_t bytes);

}  // namespace lamina::e57

// LZF (Marc Lehmann's format), as PCD's compressed data use it.
#pragma once
#include <cstdint>

#include "points/input_file.h"

namespace lamina {

/// Unpacks `packed` bytes from `offset` on into `out`, which must come to exactly `unpacked` bytes, through a small
/// window. Throws Error(unreadable) naming the byte where the data are damaged.
void unpack_lzf(const InputFile& file, std::uint64_t offset, std::uint64_t packed, std::uint64_t unpacked, Spool& out);

}  // namespace lamina

// Compressed data, unpacked as a whole before they are read: readers want any place of the file.
#pragma once
#include <cstdint>
#include <string>
#include <string_view>

#include "points/input_file.h"

namespace lamina {

bool is_gzip(std::string_view start);

/// Unpacks gzip to an unnamed file in `tmp_dir`; several members behind each other are one file.
/// Throws Error(unreadable) naming the byte where it is damaged or cut short, and for contents that are no point file;
/// Error(budget) when there is no room.
InputFile unpack_gzip(const InputFile& packed, const std::string& tmp_dir);

/// LZF (Marc Lehmann's format), as PCD's compressed data use it: unpacks `packed` bytes from `offset` on into `out`,
/// which must come to exactly `unpacked` bytes, through a small window. Throws Error(unreadable) naming the byte where
/// the data are damaged.
void unpack_lzf(const InputFile& file, std::uint64_t offset, std::uint64_t packed, std::uint64_t unpacked, Spool& out);

}  // namespace lamina

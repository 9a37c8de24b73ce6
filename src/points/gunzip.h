// gzip, unpacked as a whole before it is read: readers want any place of the file.
#pragma once
#include <string>
#include <string_view>

#include "points/input_file.h"

namespace lamina {

bool is_gzip(std::string_view start);

/// Unpacks to an unnamed file in `tmp_dir`; several members behind each other are one file.
/// Throws Error(unreadable) naming the byte where it is damaged or cut short, and for contents that are no point file;
/// Error(budget) when there is no room.
InputFile unpack_gzip(const InputFile& packed, const std::string& tmp_dir);

}  // namespace lamina

// Where the elements of a binary PLY begin and end, and whether the file holds what its header promises.
#pragma once
#include <cstdint>

#include "points/input_file.h"
#include "points/ply_header.h"

namespace lamina {

/// True when the format's byte order is not this machine's.
bool is_swapped(PlyFormat format);

/// Offset of the first row of element `wanted`. Elements without lists are skipped by arithmetic, lists are walked once
/// through a small buffer. Checks every element, and that nothing but blanks follows the last one.
/// Throws Error(unreadable) naming the element, with the rows promised and held.
std::uint64_t locate_element(const InputFile& file, const PlyHeader& header, std::size_t wanted);

}  // namespace lamina

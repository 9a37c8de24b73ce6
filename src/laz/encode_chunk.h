// Chunks of LAZ, written.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "laz/point_chunk.h"

namespace lamina::laz {

/// A chunk of `count` >= 1 records of formats 6 and 7 for decode_layered(). They are all only returns of their pulses,
/// as points without pulses are: x, y, z, intensity, colours and extra bytes may differ, all else is as in the first.
std::vector<std::byte> encode_layered(const RecordLayout& layout, const std::byte* records, std::size_t count);

/// The code of a table of chunks, which have the same number of points but for the last.
std::vector<std::byte> encode_chunk_table(std::span<const std::uint32_t> chunk_bytes);

}  // namespace lamina::laz

// Chunks of LAZ, written.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "laz/point_chunk.h"

namespace lamina::laz {

/// A chunk of `count` >= 1 records of formats 6 to 8, for decode_layered().
std::vector<std::byte> encode_layered(const RecordLayout& layout, const std::byte* records, std::size_t count);

/// The code of a table of chunks, which have the same number of points but for the last.
std::vector<std::byte> encode_chunk_table(std::span<const std::uint32_t> chunk_bytes);

}  // namespace lamina::laz

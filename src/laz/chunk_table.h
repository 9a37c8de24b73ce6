// The table of a LAZ file's chunks, itself compressed.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace lamina::laz {

struct TabledChunk {
  std::uint32_t points = 0;  ///< 0 where all chunks but the last have the same number
  std::uint32_t bytes = 0;
};

/// The table of `chunks` entries whose code is `code`; all chunks together have at most `most_bytes`. Throws Damaged.
std::vector<TabledChunk> decode_chunk_table(std::span<const std::byte> code, std::uint32_t chunks, bool with_points,
                                            std::uint64_t most_bytes);

}  // namespace lamina::laz

// Where the chunks of a LAZ file are.
#pragma once
#include <cstdint>
#include <vector>

#include "points/input_file.h"
#include "points/las_header.h"

namespace lamina {

struct LazChunk {
  std::uint64_t offset = 0, bytes = 0;  ///< in the file
  std::uint64_t first = 0;              ///< row
  std::uint64_t points = 0;
};

struct LazChunks {
  std::vector<LazChunk> chunks;
  std::uint64_t uncounted = 0;  ///< points behind those that the header counts
  bool without_table = false;   ///< the chunk table is missing or damaged
};

/// By the chunk table, wherever it stands; where it is missing or makes no sense, one chunk after another, which for
/// formats 0 to 3 takes decoding them. Memory: 32 bytes a chunk. Throws Error(unreadable) where the chunks hold fewer
/// points than the header promises, and for one that unpacks to more than kMostChunkBytes.
LazChunks find_laz_chunks(const InputFile& file, const LasHeader& header);

/// Throws Error(unreadable) for more points than the chunk's bytes can hold, or more than are unpacked at once.
void require_sensible(const LazChunk& chunk, const InputFile& file, const LasHeader& header);

inline constexpr std::uint64_t kMostChunkBytes = std::uint64_t{512} << 20;

}  // namespace lamina

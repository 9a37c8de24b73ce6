// Where the chunks of a LAZ file are, and those that are the nodes of a COPC file.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "lamina/points.h"
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

// COPC: LAZ whose chunks are the nodes of an octree, coarse ones before fine ones (copc.io, version 1.0). A node holds
// a part of the points in its cube, evenly spread; all nodes together hold all points.

/// By user and number of its record, in the list of variable length records.
inline constexpr const char* kCopcUser = "copc";
inline constexpr std::uint16_t kCopcRecord = 1;

struct CopcOctree {
  std::array<double, 3> centre{};
  double half_size = 0;                           ///< of the root's cube
  double spacing = 0;                             ///< between the points of the root; half of it in every further level
  std::uint64_t root_offset = 0, root_bytes = 0;  ///< of the first page of the list of nodes
};

/// From the contents of the record. Throws Error(unreadable), beginning with `name`.
CopcOctree parse_copc(std::span<const std::byte> record, const std::string& name);

/// The nodes that a selection asks for by resolution and box, in the order of the file. Throws Error(unreadable)
/// for a list of nodes that is damaged.
std::vector<LazChunk> find_copc_nodes(const InputFile& file, const CopcOctree& octree, const PointSelection& selection);

}  // namespace lamina

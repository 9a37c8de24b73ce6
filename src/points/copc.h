// COPC: LAZ whose chunks are the nodes of an octree, coarse ones before fine ones (copc.io, version 1.0). A node holds
// a part of the points in its cube, evenly spread; all nodes together hold all points.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "lamina/points.h"
#include "points/input_file.h"
#include "points/laz_chunks.h"

namespace lamina {

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

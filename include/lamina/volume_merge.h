// Several .vdb files into one: the files of a sequence, or volumes that belong together.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "lamina/run.h"

namespace lamina {

struct VolumeMergeStats {
  std::uint64_t grids = 0, voxels = 0, points = 0, bytes = 0;
};

/// Grids of the same name become one, others stand beside each other. Level sets are united: closed ones as solids,
/// open ones (and the files of a sequence that `surface` split) voxel by voxel, the nearer distance where both have
/// one, and the sides of the tiles between them decided anew. Of other grids the first file's voxel counts where
/// several have it. Points are put together with the attributes of all; what a file lacks is 0 there, and a warning
/// says so. The whole result is held in memory. The bytes are the same for any number of threads; "-" is standard
/// output. Throws Error: unreadable (an input), usage (no inputs; grids of one name that differ in type, class,
/// transform or band, naming both files), budget (the output cannot be written).
VolumeMergeStats merge_volumes(const std::vector<std::string>& inputs, const std::string& output,
                               const RunContext& run = {});

}  // namespace lamina

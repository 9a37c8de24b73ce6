// One reconstruction in parts: on a render farm, chunk by chunk from a store that many machines read, or in one program
// that resumes after it was killed. The mesh is the one that reconstruct_surface() writes, byte for byte.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "lamina/run.h"
#include "lamina/surface.h"

namespace lamina {

/// Reads the settings' input into a new folder `store`: samples bucketed along the sweep axis, with index, frame and
/// checksums. Only the settings that concern reading count: input, more_inputs, columns, frame, bad_samples and, where
/// the input gives radii, radius_scale; a later run on the store must not ask for different ones. The folder is an
/// input for reconstruct_surface() and reconstruct_chunk(), and appears under its name when it is complete. Throws
/// Error as reconstruct_surface() does, and Error(budget) when the folder exists already or cannot be made. The plan in
/// the result is that of the settings, as from a dry run.
SurfaceStats write_store(const SurfaceSettings& settings, const std::string& store, const RunContext& run);

/// Whether an input is a folder that write_store() has made. False for anything else, also for what is not there.
bool is_store(const std::string& input);

/// Chunk `number` of `count`: 1 <= number <= count.
struct Chunk {
  int number = 1, count = 1;
};

struct ChunkStats {
  SurfaceStats surface;                    ///< of this chunk's run, overlap included
  std::int64_t first_slab = 0, slabs = 0;  ///< the chunk's own, from the cloud's first on
  std::int64_t all_slabs = 0;      ///< of all chunks: the cloud's, and those beside it that the surface may enter
  std::int64_t overlap_slabs = 0;  ///< projected in addition to the chunk's own
  std::uint64_t samples = 0;       ///< about so many lie in its own slabs
};

/// Reconstructs one chunk of the store that settings.input names and writes it to settings.output, a part file for
/// merge_parts(). Chunks are cut so that each takes about the same time; where there are more chunks than slabs, some
/// are empty. A part depends on store, settings and chunk alone, not on the machine or the number of threads.
/// Throws Error as reconstruct_surface() does, except that a chunk may be without surface; Error(usage) when the input
/// is not a store, for a chunk out of range, and for .vdb grids, which chunks cannot make.
ChunkStats reconstruct_chunk(const SurfaceSettings& settings, const Chunk& chunk, const RunContext& run);

/// What merge_parts() wrote.
struct MergedParts {
  std::uint64_t vertices = 0, triangles = 0;
  int parts = 0;
  HoleStats holes;
  SimplifyStats simplified;  ///< where it was asked for: `vertices` and `triangles` are those left
};

/// True when the file begins as a part does. False for a file that cannot be opened.
bool is_part(const std::string& path);

/// Joins all parts of one reconstruction, given in any order, into one mesh, closes its holes, and writes it under each
/// name of `outputs`, at least one (format by its ending; "-" is standard output). It is simplified first as
/// `wanted` says; where that is unset, as the run would have done that made the parts. Memory grows with the boundary
/// of a part, not with the mesh. run.tmp_dir is for what goes to standard output (empty: the system's). Throws
/// Error(unreadable) naming the part that is missing, given twice, truncated, damaged, of another run or of a version
/// this program does not know; Error(empty) when no part has surface; Error(budget) when the mesh has more than 2^32 -
/// 1 vertices or cannot be written.
MergedParts merge_parts(const std::vector<std::string>& paths, const std::vector<std::string>& outputs,
                        const RunContext& run, const std::optional<SimplifySettings>& wanted = std::nullopt);

struct Checkpoint {
  std::string directory;  ///< holds the store and the finished parts; made where it is not there, removed at the end
  bool resume = false;    ///< continue from what the folder holds
};

/// Does what reconstruct_surface() does, but may be killed at any moment: called again with the same settings and
/// `resume`, it goes on after the last part it finished, or begins where there is nothing to resume. Needs disk for the
/// store, which is kept until the end, and for the mesh once more.
/// Throws Error as reconstruct_surface() does, and Error(usage) with the remedy when the folder holds the checkpoint of
/// another run, any checkpoint without `resume`, or other files, when it is in use, for standard input and for grids.
SurfaceStats reconstruct_resumable(const SurfaceSettings& settings, const Checkpoint& checkpoint,
                                   const RunContext& run);

}  // namespace lamina

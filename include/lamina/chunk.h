// One reconstruction in pieces: on a render farm, chunk by chunk from a store that many machines read, and in one
// program that can go on after it was killed. The mesh is the same, byte for byte, as reconstruct_surface() writes.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "lamina/run.h"
#include "lamina/surface.h"

namespace lamina {

/// Reads the settings' input into a new folder `store`: samples bucketed along the sweep axis, with index, frame and
/// checksums. Of the settings only those of reading count: input, more_inputs, columns, frame, bad_samples and, where
/// the input gives radii, radius_scale; whoever uses the store must not ask for others. reconstruct_surface() and
/// reconstruct_chunk() take the folder as their input. The folder appears under its name when complete.
/// Throws Error as reconstruct_surface() does, and Error(budget) when the folder is there already or cannot be made.
/// stats.plan is that of the settings, as from a dry run.
SurfaceStats write_store(const SurfaceSettings& settings, const std::string& store, const RunContext& run);

/// Chunk `number`, from 1 on, of `count`.
struct Chunk {
  int number = 1, count = 1;
};

struct ChunkStats {
  SurfaceStats surface;                    ///< of the whole run of this chunk, its overlap included
  std::int64_t first_slab = 0, slabs = 0;  ///< the chunk's own, from the cloud's first on
  std::int64_t all_slabs = 0;              ///< of all chunks: the cloud's and those beside it that surface may reach
  std::int64_t overlap_slabs = 0;          ///< projected beside the chunk's own
  std::uint64_t samples = 0;               ///< about so many lie in its own slabs
};

/// Reconstructs one chunk of the store that settings.input names, and writes it to settings.output, a part for
/// merge_parts(). Chunks are cut so that they take about the same time; there may be more of them than slabs, some are
/// empty then. A part is a function of store, settings and chunk: any machine, any number of threads, again and again.
/// Throws Error as reconstruct_surface(), but a chunk without surface is no error; Error(usage) where the input is no
/// store, for a chunk out of range, and for grids, which chunks cannot make.
ChunkStats reconstruct_chunk(const SurfaceSettings& settings, const Chunk& chunk, const RunContext& run);

struct MergedParts {
  std::uint64_t vertices = 0, triangles = 0;
  int parts = 0;
  HoleStats holes;
};

/// Whether a file claims to be a part.
bool is_part(const std::string& path);

/// Joins all the parts (`paths`) of one reconstruction, given in any order, to the mesh `output` ("-": standard
/// output), and closes its holes. Memory does not grow with the mesh, but with the rims of a part. `tmp_dir` is for
/// what goes to standard output; empty: the system's. Throws Error(unreadable) naming the part that is missing, there
/// twice, truncated, damaged, of another run or of a version this program does not know; Error(empty) when no part has
/// surface; Error(budget) when the mesh has more than 2^32 - 1 vertices or cannot be written.
MergedParts merge_parts(const std::vector<std::string>& paths, const std::string& output, const RunContext& run);

struct Checkpoint {
  std::string directory;  ///< holds the store and the finished parts; made where it is not there, removed at the end
  bool resume = false;    ///< go on with what is there
};

/// reconstruct_surface() in such a way that, killed at any moment, it can go on after the last part it finished: the
/// same settings with `resume`. Without anything to resume it begins. Takes the disk of the store, which is kept until
/// the end, and of the mesh once more.
/// Throws Error(usage), with the remedy, when the folder holds another run's or, without `resume`, any checkpoint,
/// holds other files, or is in use; for standard input, and for grids.
SurfaceStats reconstruct_resumable(const SurfaceSettings& settings, const Checkpoint& checkpoint,
                                   const RunContext& run);

}  // namespace lamina

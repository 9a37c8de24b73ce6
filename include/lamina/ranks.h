// One reconstruction by several processes that a launcher (mpirun, srun) starts on one machine or many. The mesh is the
// one that reconstruct_surface() writes, byte for byte.
#pragma once
#include <cstdint>
#include <vector>

#include "lamina/run.h"
#include "lamina/surface.h"

namespace lamina {

/// The number of processes started together with this one, and which of them it is (0 <= rank < size), as the
/// launcher's environment variables say. One of one without a launcher.
struct Launch {
  int rank = 0, size = 1;
};
Launch launch();

/// What one rank did. Seconds are wall clock, except for `cpu`.
struct RankStats {
  std::int64_t first_slab = 0, slabs = 0;  ///< of its own, counted from the cloud's first
  std::int64_t overlap_slabs = 0;          ///< projected in addition to its own
  std::uint64_t rows_read = 0;             ///< of the input
  std::uint64_t samples = 0;               ///< about so many lie in its own slabs
  std::uint64_t samples_held = 0;          ///< in its store, including those beside its slabs
  std::uint64_t vertices = 0, triangles = 0;
  double seconds = 0, cpu = 0;           ///< of the whole run; processor seconds of all threads
  double sweeping = 0;                   ///< reconstructing its slabs
  double waited = 0;                     ///< waiting for other ranks and for messages
  std::uint64_t sent = 0, received = 0;  ///< bytes
  std::uint64_t peak_memory = 0;         ///< bytes
};

/// What all ranks did together.
struct RanksStats {
  SurfaceStats surface;          ///< of all ranks: counts are sums, in which overlapping slabs count more than once
  std::vector<RankStats> ranks;  ///< on rank 0; elsewhere empty
};

/// Does what reconstruct_surface() does, by all the processes of the launch together. Each calls it with the same
/// settings, once in its life, as it starts and ends MPI. Each rank reads a part of the rows (rank 0 reads all where
/// they can only be read in order), samples go to the ranks that work on their slabs, and all write one file.
/// run.threads and run.max_memory are those of one rank. All must see the output's folder; run.tmp_dir may be local to
/// each machine. Messages and progress come from rank 0 alone.
///
/// Throws Error as reconstruct_surface() does, the same one on all ranks, that of the lowest rank that failed;
/// Error(usage) for .vdb grids, dry runs, standard output, pipes and devices, for a program built without MPI, and for
/// a launcher of another MPI.
RanksStats reconstruct_ranks(const SurfaceSettings& settings, const RunContext& run);

}  // namespace lamina

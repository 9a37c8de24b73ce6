// One reconstruction by several processes that a launcher (mpirun, srun) started on one machine or many. The mesh is
// the same, byte for byte, as reconstruct_surface() writes.
#pragma once
#include <cstdint>
#include <vector>

#include "lamina/run.h"
#include "lamina/surface.h"

namespace lamina {

/// How many processes this one was started with, as the launcher's environment says, and which of them it is.
struct Launch {
  int rank = 0, size = 1;
};
Launch launch();

/// What one rank did. Seconds are wall clock unless told otherwise.
struct RankStats {
  std::int64_t first_slab = 0, slabs = 0;  ///< of its own, counted from the cloud's first
  std::int64_t overlap_slabs = 0;          ///< projected beside its own
  std::uint64_t rows_read = 0;             ///< of the input
  std::uint64_t samples = 0;               ///< about so many lie in its own slabs
  std::uint64_t samples_held = 0;          ///< in its store, those beside its slabs included
  std::uint64_t vertices = 0, triangles = 0;
  double seconds = 0, cpu = 0;           ///< of the whole run; processor seconds of all threads
  double sweeping = 0;                   ///< reconstructing its slabs
  double waited = 0;                     ///< for other ranks and for messages
  std::uint64_t sent = 0, received = 0;  ///< bytes
  std::uint64_t peak_memory = 0;         ///< bytes
};

struct RanksStats {
  SurfaceStats surface;          ///< of all ranks: counts are sums, which see slabs beside a rank's own once more
  std::vector<RankStats> ranks;  ///< on rank 0; elsewhere empty
};

/// reconstruct_surface() by all the processes of the launch together; each calls it with the same settings, once in its
/// life (MPI is begun and ended). Each reads a part of the rows; what can only be read in order rank 0 reads for all.
/// Samples then go where their slabs are worked on, and all write one file. run.threads and run.max_memory are a
/// rank's. The output's folder must be seen by all; run.tmp_dir may be each machine's own. Messages and progress are
/// rank 0's alone.
///
/// Throws Error as reconstruct_surface(), the same one on all ranks: that of the lowest rank that failed; Error(usage)
/// for grids, dry runs, standard output, pipes and devices, for a program built without MPI, and for another MPI's
/// launcher.
RanksStats reconstruct_ranks(const SurfaceSettings& settings, const RunContext& run);

}  // namespace lamina

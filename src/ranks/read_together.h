// The input read by all ranks: each has the samples of its rows in a store of its own.
#pragma once
#include <cstdint>
#include <optional>
#include <string>

#include "ranks/ranks.h"
#include "reconstruct/sweep.h"

namespace lamina::ranks {

struct SharedInput {
  SweepInput input;        ///< its store has this rank's samples, and counts those of all (declare_shares())
  std::uint64_t rows = 0;  ///< read by this rank
  std::optional<NormalsReport> normals;  ///< where rank 0 has found some
};

/// Rows are cut into one run per rank, in order: a bucket's samples in input order are those of rank 0, then of rank 1,
/// ... Frame and buckets are those of one process. `run` differs by rank in what it says, not in what is cancelled.
SharedInput read_together(Ranks& ranks, const SurfaceSettings& settings, const std::string& directory,
                          const RunContext& run, Stopwatch& watch);

}  // namespace lamina::ranks

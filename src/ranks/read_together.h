// The input read by all ranks: each has the samples of its rows in a store of its own.
#pragma once
#include <cstdint>
#include <optional>
#include <string>

#include "ranks/ranks.h"
#include "reconstruct/job.h"

namespace lamina::ranks {

struct SharedInput {
  StoredCloud cloud;       ///< its store has this rank's samples, and counts those of all (declare_shares())
  std::uint64_t rows = 0;  ///< read by this rank
};

/// Rows are cut into one run per rank, in order: a bucket's samples in input order are those of rank 0, then of rank 1,
/// ... Frame and buckets are those of one process. The job's run differs by rank in what it says, not in what is
/// cancelled; where rank 0 has found normals, its statistics say so.
SharedInput read_together(Ranks& ranks, const SurfaceSettings& settings, const std::string& directory, Job& job);

}  // namespace lamina::ranks

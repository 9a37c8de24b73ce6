// The input read by all ranks: each has the samples of its rows in a store of its own. Where only rank 0 can read, it
// deals the rows out, and the others store them.
#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "lamina/points.h"
#include "ranks/ranks.h"
#include "reconstruct/job.h"
#include "store/ingest.h"

namespace lamina::ranks {

/// In the place of the input on the other ranks: the rows that rank 0 sends, in order.
class DealtRows : public PointSource {
 public:
  DealtRows(Ranks& ranks, const PointSourceInfo& info);
  /// Runs work that reads. Rank 0 meanwhile is in deal_rows().
  void take(const std::function<void()>& work);
  /// Throws Error(internal) when rank 0 has no more, for it or another has failed.
  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override;

 private:
  Ranks& ranks_;
};

/// Rank 0: does its own `work` with the source, then deals out what the others want, rank after rank, a batch ahead of
/// them. Whatever fails, no rank is left waiting. `share`: the rows of a rank.
void deal_rows(Ranks& ranks, PointSource& source, const std::function<void()>& work,
               const std::function<RowSpan(int rank)>& share);

struct SharedInput {
  StoredCloud cloud;       ///< its store has this rank's samples, and counts those of all (declare_shares())
  std::uint64_t rows = 0;  ///< read by this rank
};

/// Rows are cut into one run per rank, in order: a bucket's samples in input order are those of rank 0, then of rank 1,
/// ... Frame and buckets are those of one process. The job's run differs by rank in what it says, not in what is
/// cancelled; where rank 0 has found normals, its statistics say so.
SharedInput read_together(Ranks& ranks, const SurfaceSettings& settings, const std::string& directory, Job& job);

}  // namespace lamina::ranks

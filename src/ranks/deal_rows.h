// An input that only rank 0 reads: it deals the rows out, so that the others store them.
#pragma once
#include <functional>

#include "lamina/points.h"
#include "ranks/ranks.h"
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

}  // namespace lamina::ranks

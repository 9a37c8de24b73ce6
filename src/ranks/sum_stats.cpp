#include "ranks/sum_stats.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

namespace lamina::ranks {
namespace {

/// The undersampled are found by each rank alone; slabs beside a rank's own are seen by two.
constexpr const char* kUndersampled = "radius above --max-radius";

std::uint64_t take_undersampled(SurfaceStats& stats) {
  const auto found = std::find_if(stats.rejected.begin(), stats.rejected.end(),
                                  [](const Rejected& r) { return r.reason == kUndersampled; });
  if (found == stats.rejected.end()) return 0;
  const std::uint64_t count = found->count;
  stats.rejected.erase(found);
  return count;
}

}  // namespace

void sum_stats(Ranks& ranks, SurfaceStats& stats) {
  std::uint64_t undersampled = take_undersampled(stats);
  std::array<std::int64_t, 2> most{static_cast<std::int64_t>(stats.peak_memory),
                                   static_cast<std::int64_t>(stats.leaf_cells.size())};
  ranks.most(most);
  stats.peak_memory = static_cast<std::uint64_t>(most[0]);
  stats.leaf_cells.resize(static_cast<std::size_t>(most[1]), 0);
  constexpr double kMicro = 1e-6;
  auto cpu = static_cast<std::uint64_t>(std::llround(stats.cpu / kMicro));
  ClusterCounts& c = stats.clusters;
  std::vector<std::uint64_t*> counts{&undersampled,        &cpu,
                                     &stats.corners,       &stats.corner_sums,
                                     &stats.corners_seen,  &stats.corners_good,
                                     &stats.corners_torn,  &stats.isovertices,
                                     &stats.isotriangles,  &stats.rejected_loops,
                                     &stats.general_cells, &stats.crossing_cells,
                                     &stats.disk_bytes,    &c.corners,
                                     &c.collapsed,         &c.patches,
                                     &c.kept_isovertices,  &c.hard};
  for (std::uint64_t& cells : stats.leaf_cells) counts.push_back(&cells);
  std::vector<std::uint64_t> values;
  values.reserve(counts.size());
  for (const std::uint64_t* count : counts) values.push_back(*count);
  ranks.sum(values);
  for (std::size_t i = 0; i < counts.size(); ++i) *counts[i] = values[i];
  stats.cpu = static_cast<double>(cpu) * kMicro;
  if (undersampled > 0) stats.rejected.push_back({kUndersampled, undersampled, std::nullopt});
}

}  // namespace lamina::ranks

// From a tile's sums to the values in its block.
#pragma once
#include <cstdint>
#include <vector>

#include "mls/queries.h"

namespace lamina {

/// The fits of a tile's queries, and what they are worth.
struct TileFit {
  std::vector<FitOutput> fits;        ///< by group of eight queries; those of unseen groups are left as they were
  std::vector<std::uint8_t> seen;     ///< by query: samples near enough contributed
  std::vector<std::uint8_t> trusted;  ///< by query: the fit is trusted
};

struct FitCounts {
  std::uint64_t seen = 0, trusted = 0;
  std::uint64_t torn = 0;  ///< queries that see normals which contradict each other
};

/// `channels`: kSums + attributes.
FitCounts fit_tile(const Kernel& kernel, const ProjectSettings& settings, std::size_t channels, const TileState& state,
                   const std::vector<Query>& queries, TileFit& out);

/// Writes what later stages need into the slab's layers of the block: `seen`, `trusted`, the signs of the seen points'
/// own distances in `outside` (corners only), and the values, for the seen points alone: `active` becomes `seen`.
/// Corners that a finer level holds take its values: it must be done.
void store_values(Window& window, int level, const Work& work, const std::vector<Query>& queries,
                  const TileState& state, const TileFit& fit);

}  // namespace lamina

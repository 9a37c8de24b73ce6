// From a tile's sums to the values in its block, and what a block takes over from finer levels.
#pragma once
#include <cstdint>
#include <vector>

#include "mls/creases.h"
#include "mls/overhang.h"
#include "mls/queries.h"

namespace lamina {

/// Normals contradict each other where their mean is shorter than this: half of what one surface's is.
inline constexpr float kTorn = 0.5F;

/// A single sample is no surface: what sees no other counts as this far from it (support radii), too far for a corner
/// to stand on its own. All of one sample's corners lead to the same point, and triangles between them have no area.
inline constexpr float kAlone = 1;

/// The mean of what a fit leaves of its samples is its own error, not noise, where it is more than this share of their
/// scatter: the fit levels what is as narrow as its support. Below the share that counts goes to zero.
inline constexpr float kResidualShare = 0.5F;
/// Means of this size (support radii) or more are of strays and other sheets, and count nothing (Tukey's biweight).
inline constexpr float kMostResidual = 0.25F;
/// Where samples lie to one side (offset from their mean, support radii) their residuals tell less and less.
inline constexpr float kResidualOffset = 0.2F;

/// The fits of a tile's queries, and what they are worth.
struct TileFit {
  std::vector<FitOutput> fits;        ///< by group of eight queries; those of unseen groups are left as they were
  std::vector<std::uint8_t> seen;     ///< by query: samples near enough contributed
  std::vector<std::uint8_t> trusted;  ///< by query: the fit is trusted
  /// By query, packed_crease(); empty where the tile has no creases.
  std::vector<std::array<float, 2>> creases;
};

/// Fits all queries of a tile, those with creases by their sheets, and counts what came of them.
void fit_tile(const ProjectRule& rule, const TileState& state, const std::vector<Query>& queries,
              const std::vector<Crease>& creases, TileFit& out, ProjectCounts& counts);

/// Writes what later stages need into the slab's layers of the block: `seen`, `trusted`, the signs of the seen points'
/// own distances in `outside` (corners only), and the values, for the seen points alone: `active` becomes `seen`.
/// Corners that a finer level holds take its values: it must be done.
void store_values(const ProjectRule& rule, Window& window, const Work& work, const std::vector<Query>& queries,
                  const TileState& state, const TileFit& fit);

/// Makes room for the values of the active points in the layers of a block (one slab's); false when there are none.
bool allocate_values(const Window& window, int level, Projected& points, LeafLayers layers);

/// Takes over what finer levels have for the tile's shared corners in the layers.
void copy_shared(Window& window, int level, const Tile& tile, LeafLayers layers);

}  // namespace lamina

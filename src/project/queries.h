// The points of a tile that are projected, eight at a time, and what becomes of them between batches and steps.
#pragma once
#include <cstdint>
#include <vector>

#include "project/kernel.h"
#include "project/project.h"
#include "project/tile_samples.h"
#include "window/window.h"

namespace lamina {

struct Work {
  Tile tile;
  Projected* points = nullptr;  ///< the block's corners, or its cell centres
  int begin = 0, end = 0;       ///< leaf layers of the slab
};

/// A point to project, in the tile's compact order.
struct Query {
  std::uint8_t x, y, z;
};

/// What a tile keeps between batches and steps: per query the query point and the running sums, lane groups of eight.
struct TileState {
  std::vector<Queries> points;  ///< query points, cells relative to the tile
  std::vector<Lanes> sums;      ///< per group kSums + attributes lanes
};

/// Cell centres lie half a cell above their corner.
inline float shift_of(const ProjectSettings& settings) {
  return settings.centres ? 0.5F : 0.0F;
}

/// Corners farther than this (cells) from their surface gain nothing from further steps.
inline constexpr float kStepLimit = 1.5F;

/// The near points of the slab that this level projects itself: not those that a finer level holds too.
void list_queries(const Work& work, std::vector<Query>& out);
/// Puts the query points on the corners (or centres) and clears the sums.
void start(TileState& state, const std::vector<Query>& queries, std::size_t channels, float shift);
/// Moves the query points to the projected points for the next step and clears the sums.
void advance(const Kernel& kernel, const ProjectSettings& settings, TileState& state, const std::vector<Query>& queries,
             std::size_t channels);
/// Adds the samples to the sums.
void accumulate(const Kernel& kernel, const RowSamples& rows, TileState& state, std::size_t channels);
/// How the sums of a group become points.
FitInput fit_input(const TileState& state, const std::vector<Query>& queries, std::size_t group, Fit fit, float shift);

}  // namespace lamina

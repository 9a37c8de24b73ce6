// The points of a tile that are projected, eight at a time, and what becomes of them between batches and steps.
#pragma once
#include <cstdint>
#include <vector>

#include "mls/kernel.h"
#include "mls/project.h"
#include "mls/tile_samples.h"
#include "octree/window.h"

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

/// Query points and their running sums, in lane groups of eight; the last group is filled up with copies of its last
/// point.
struct QueryBatch {
  std::vector<Queries> points;  ///< cells relative to the tile
  std::vector<Queries> facing;  ///< samples whose normals point away from these do not count; zero: all do
  std::vector<Lanes> sums;      ///< per group kSums + attributes lanes
};

/// What a tile keeps between batches and steps.
struct TileState {
  QueryBatch all;                     ///< every query's
  std::vector<std::uint32_t> moving;  ///< queries that go on, after the first pass
  QueryBatch moved;                   ///< of those
  std::uint64_t sums = 0;             ///< points summed up so far, those of every pass
  bool stepped = false;               ///< `moved` is the one to add samples to
};

/// Cell centres lie half a cell above their corner.
inline float shift_of(const ProjectSettings& settings) {
  return settings.centres ? 0.5F : 0.0F;
}

/// Corners farther than this (cells) from their surface gain nothing from further steps.
inline constexpr float kStepLimit = 1.5F;
/// Query points that a step moves by no more than this (cells) stay where they are, with the sums they have.
inline constexpr float kStill = 1e-3F;

/// the active points of the slab that this level projects itself: not those that a finer level holds too. By groups of
/// 2^3, so that the eight of a group lie close together and few samples act on any of them.
void list_queries(const Work& work, std::vector<Query>& out);
/// Puts the query points on the corners (or centres) and clears the sums.
void start(TileState& state, const std::vector<Query>& queries, std::size_t channels, float shift);
/// How often the samples are looked at: once a step, and once more for points between two sheets.
inline int passes_of(const ProjectSettings& settings) {
  return settings.steps + (settings.sheets > 0 ? 1 : 0);
}
/// Ends a pass and prepares the next one, `pass` (1 is the second). Query points move to the projected points; only
/// those that move go on. After the first pass those that see two sheets stay where they are and are summed up again
/// without the samples that face the other way, one pass behind the others from then on. False when none goes on.
bool advance(const Kernel& kernel, const ProjectSettings& settings, TileState& state, const std::vector<Query>& queries,
             std::size_t channels, int pass);
/// Adds the samples to the sums of the points that go on.
void accumulate(const Kernel& kernel, const RowSamples& rows, TileState& state, std::size_t channels);
/// Ends the steps: `all` has every query's last point and sums; those between sheets have one sheet's where the two lie
/// apart and that sheet can be trusted there.
void settle(const Kernel& kernel, const ProjectSettings& settings, TileState& state, const std::vector<Query>& queries,
            std::size_t channels);
/// How the sums of a group of `all` become points.
FitInput fit_input(const TileState& state, const std::vector<Query>& queries, std::size_t group, Fit fit, float shift);

}  // namespace lamina

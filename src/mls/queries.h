// The points of a tile that are projected, eight at a time, and what becomes of them between batches and steps.
#pragma once
#include <cstdint>
#include <vector>

#include "mls/kernel.h"
#include "mls/project.h"
#include "mls/row_samples.h"
#include "octree/window.h"

namespace lamina {

/// Corners farther than this (cells) from their surface gain nothing from further steps.
inline constexpr float kStepLimit = 1.5F;
/// Query points that a step moves by no more than this (cells) stay where they are, with the sums they have.
inline constexpr float kStill = 1e-3F;
/// Two sheets face opposite ways where the cosine between their mean normals is less than this (135 degrees): sheets of
/// a wall or a slit do, the flanks of an edge do not.
inline constexpr float kOpposed = -0.7F;

struct Work {
  Tile tile;
  Projected* points = nullptr;  ///< the block's corners, or its cell centres
  LeafLayers layers{0, 0};      ///< of the slab
  int level = 0;
  [[nodiscard]] bool corners() const { return points == tile.leaf; }
  /// The points of a layer that the level projects itself: not those that a finer level holds too.
  [[nodiscard]] std::uint64_t own(int z) const {
    return points->active.words[z] & ~(corners() ? tile.leaf->shared.words[z] : 0);
  }
};

/// A point to project, in the tile's compact order. A word, so that four are made at once.
struct alignas(4) Query {
  std::uint8_t x, y, z;
};

/// The points of the slab that this level projects itself. By groups of 2^3, so that the eight of a group lie close
/// together and few samples act on any of them.
void list_queries(const Work& work, std::vector<Query>& out);

/// Query points and their running sums, in lane groups of eight; the last group is filled up with copies of its last
/// point.
struct QueryBatch {
  std::vector<Queries> points;  ///< cells relative to the tile
  std::vector<Queries> facing;  ///< samples whose normals point away from these do not count; zero: all do
  std::vector<Lanes> sums;      ///< per group ProjectRule::channels lanes
  [[nodiscard]] std::size_t channels() const { return points.empty() ? 0 : sums.size() / points.size(); }
};

/// What a tile keeps between batches and steps.
struct TileState {
  QueryBatch all;                     ///< every query's
  std::vector<std::uint32_t> moving;  ///< queries that go on, after the first pass
  QueryBatch moved;                   ///< of those
  std::uint64_t sums = 0;             ///< points summed up so far, those of every pass
  bool stepped = false;               ///< `moved` is the one to add samples to
};

/// How points are projected.
struct ProjectRule {
  const Kernel& kernel;
  const ProjectSettings& settings;
  std::size_t channels;  ///< of a group's sums: kSums + attributes (+ kResidualSums)
  float cell = 1;        ///< of the level, steps

  /// Cell centres lie half a cell above their corner.
  [[nodiscard]] float shift() const { return settings.centres ? 0.5F : 0.0F; }
  /// How often the samples are looked at: once a step, and once more for points between two sheets.
  [[nodiscard]] int passes() const { return settings.steps + (settings.sheets > 0 ? 1 : 0); }
};

/// The steps of one tile's queries; a view of what is kept.
class TileSteps {
 public:
  TileSteps(const ProjectRule& rule, const std::vector<Query>& queries, TileState& state)
      : rule_(rule), queries_(queries), state_(state) {}

  /// Puts the query points on the corners (or centres) and clears the sums.
  void start();
  /// Adds the samples to the sums of the points that go on.
  void accumulate(const RowSamples& rows);
  /// Ends a pass and prepares the next one, `pass` (1 is the second). Query points move to the projected points; only
  /// those that move go on. After the first pass those that see two sheets stay where they are and are summed up again
  /// without the samples that face the other way, one pass behind the others from then on. False when none goes on.
  bool advance(int pass);
  /// Ends the steps: `all` has every query's last point and sums; those between sheets have one sheet's where the two
  /// lie apart and that sheet can be trusted there.
  void settle();

 private:
  struct Next;
  [[nodiscard]] std::uint32_t query_of(std::size_t i) const {
    return state_.stepped ? state_.moving[i] : static_cast<std::uint32_t>(i);
  }
  void advance_group(std::size_t g, std::size_t count, int pass, Next& next) const;
  [[nodiscard]] bool sees_two_sheets(const Lanes* sums, int l) const;
  [[nodiscard]] bool any_sees_two_sheets(const Lanes* sums) const;
  [[nodiscard]] bool is_apart(const Lanes* all, int lane, const Lanes* own_side, int l) const;

  const ProjectRule& rule_;
  const std::vector<Query>& queries_;
  TileState& state_;
};

/// How the sums of a group of `all` become points.
FitInput fit_input(const ProjectRule& rule, const TileState& state, const std::vector<Query>& queries,
                   std::size_t group);

}  // namespace lamina

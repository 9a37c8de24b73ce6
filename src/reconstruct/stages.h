// How far each stage of the sweep is ahead and behind: the one table from which the order of the pipeline, the slabs a
// part of the sweep has to work on, the cost of a cut, the memory model and the picture in docs/architecture.md follow.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <string>

#include "lattice/lattice.h"

namespace lamina {

/// Slabs [begin, end).
struct SlabSpan {
  std::int32_t begin = 0, end = 0;
  [[nodiscard]] bool empty() const { return begin >= end; }
  [[nodiscard]] std::int32_t size() const { return end - begin; }
  bool operator==(const SlabSpan&) const = default;
};

/// Slabs a cell can be touched from: three cells of the coarsest level, each a slab high.
inline constexpr std::int32_t kTouchSlabs = 3;

enum class Stage : std::uint8_t { mark, refine, place, project, extend, number, triangulate };
inline constexpr std::size_t kStages = 7;

struct StageReach {
  const char* name;    ///< as the statistics and the picture call it
  std::int32_t ahead;  ///< slabs above the one being triangulated that the stage has done by then
  /// Slabs below and above the finished ones asked for that the stage must work on, so that these, and the numbers of
  /// those just below, are the ones of a sweep through all slabs (docs/scaling.md).
  std::int32_t below, above;
  const char* why;
};

inline constexpr std::array<StageReach, kStages> kStageReach{{
    {"mark", 3 + kTouchSlabs, 14 + kTouchSlabs, 12 + kTouchSlabs, "samples touch cells three slabs away"},
    {"refine", 3, 14, 12, "a corner belongs to the cells of the slab below, too"},
    {"place", 3, 13, 12, "corners of the cells; the values of a slab are extended from those above it"},
    {"project", 3, 13, 12, "as place; with diffusion a slab more below, for the centres of its cells"},
    {"extend", 2, 12, 11, "signs by the values around, a slab either way"},
    {"number", 1, 12, 11, "an edge's ends lie in its slab and on the first plane above"},
    {"triangulate", 0, 12, 10,
     "clusters look two slabs down and two up, fans and vertices at one position one further down, rims six further "
     "down and seven up"},
}};

/// Slabs more either way where edges turn along creases (kFlipReach), which the triangles of the slabs around say.
inline constexpr std::int32_t kFlipSlabs = 2;
/// And where normals are settled by the triangles around (kSettleReach).
inline constexpr std::int32_t kSettleSlabs = 1;

constexpr const StageReach& reach_of(Stage stage) {
  return kStageReach[static_cast<std::size_t>(stage)];
}

// Each stage works on what those before it have left.
static_assert(reach_of(Stage::mark).ahead == reach_of(Stage::refine).ahead + kTouchSlabs);
static_assert(reach_of(Stage::extend).ahead < reach_of(Stage::project).ahead &&
              reach_of(Stage::number).ahead < reach_of(Stage::extend).ahead &&
              reach_of(Stage::triangulate).ahead < reach_of(Stage::number).ahead);
static_assert(reach_of(Stage::project).below > reach_of(Stage::extend).below &&
              reach_of(Stage::project).above > reach_of(Stage::extend).above);

/// All slabs that can hold surface, and one that holds the upper corners of their cells.
inline SlabSpan all_slabs(const Lattice& lattice, const Extent& extent) {
  return {lattice.slab_of(extent.z_min) - kTouchSlabs, lattice.slab_of(extent.z_max) + kTouchSlabs + 2};
}

/// What asks for more slabs than the table has.
struct WiderReach {
  bool diffuse = false;  ///< corners follow the centres of the slab below
  bool creases = false;  ///< edges turn along them
  bool settles = false;  ///< triangles settle the normals of their vertices
};

/// The slabs each stage works on for the finished slabs of a span.
class StageSpans {
 public:
  /// `all`: all_slabs().
  StageSpans(const SlabSpan& span, const SlabSpan& all, const WiderReach& wider) {
    const std::int32_t more = (wider.creases ? kFlipSlabs : 0) + (wider.settles ? kSettleSlabs : 0);
    for (std::size_t s = 0; s < kStages; ++s) {
      const bool centres = wider.diffuse && s == static_cast<std::size_t>(Stage::project);
      const std::int32_t below = kStageReach[s].below + more + (centres ? 1 : 0);
      spans_[s] = {std::max(all.begin, span.begin - below), std::min(all.end, span.end + kStageReach[s].above + more)};
    }
  }
  [[nodiscard]] const SlabSpan& of(Stage stage) const { return spans_[static_cast<std::size_t>(stage)]; }

 private:
  std::array<SlabSpan, kStages> spans_;
};

/// The table as a picture in plain text: slabs run to the right, a row for each stage.
std::string draw_stages();

}  // namespace lamina

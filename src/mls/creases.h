// Sharp edges and corners of a surface: where the normals around a point fall into two or three tight groups, each is
// fitted by itself, and the surface is where they meet (sheets.h).
//
// How the normals of the samples around a point vary tells an edge from a bend: split across their principal direction,
// those of an edge leave next to nothing within the two halves, those of an even bend a quarter. Only sums over samples
// are needed, two passes for an edge and two more for a corner, and only at points whose normals vary at all.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "mls/kernel.h"
#include "mls/queries.h"
#include "mls/sheets.h"

namespace lamina {

/// Variance of the normals (of length one) up to which a point sees one sheet: two that meet at a right angle have so
/// much when one of them has a two-hundredth of the weight.
inline constexpr double kLeastVariance = 0.01;
/// What of the variance the sheets of an edge may keep within them; two halves of an even bend keep a quarter.
inline constexpr double kMostWithin = 0.2;
/// How far the samples of a sheet may lie from it, root mean square, supports: more are several, one above another.
inline constexpr double kMostThickness = 0.1;
/// How far the samples around a point of an edge may lie to one side, supports: further than one surface's, since each
/// sheet has but half of them.
inline constexpr double kMostLean = 0.6;

/// A point with its sheets.
struct Crease {
  std::uint32_t query = 0;
  SheetsValue value;   ///< cells
  double support = 0;  ///< mean R of the samples, cells
};

/// Points of a tile that may see several sheets, and what is known of them between batches.
struct CreaseState {
  struct Region {
    std::array<float, 3> first{}, second{};
    float first_least = 0, second_least = 0;
  };
  struct Point {
    std::uint32_t query = 0;
    std::uint8_t sheets = 1;        ///< so far
    std::uint8_t loose = 0;         ///< the one to be split
    meshes::Vec3 loose_mean{};      ///< of its normals
    std::array<Region, 3> regions;  ///< of the sheets
  };
  std::vector<Point> points;
  std::vector<Queries> at;                           ///< by group of eight points
  std::array<std::vector<NormalRegion>, 3> regions;  ///< of the sheets, or of the loose one, by group
  std::array<std::vector<Lanes>, 3> sums;            ///< of the sheets, kSheetSums a group
  std::vector<Lanes> moments;                        ///< of the loose sheet, kMoments and its weight a group
  bool splitting = false;                            ///< the pass sums up moments
  std::vector<Crease> found;
};

/// The creases of one tile, after its last step; a view of what is kept.
class CreaseFinder {
 public:
  CreaseFinder(const ProjectRule& rule, const std::vector<Query>& queries, const TileState& tile, CreaseState& state)
      : rule_(rule), queries_(queries), tile_(tile), state_(state) {}

  /// Lists the points to look at; false when there are none.
  bool start();
  /// Adds samples to the sums of the pass.
  void accumulate(const RowSamples& rows);
  /// Ends a pass and prepares the next; false when there is none.
  bool advance();

 private:
  void begin_splitting();
  void begin_sheets();
  void split();
  void judge();
  [[nodiscard]] unsigned varying(std::size_t group) const;
  [[nodiscard]] bool may_crease(std::uint32_t query, meshes::Vec3& mean) const;
  /// The sheets of a point as fits; how many.
  std::size_t fit_sheets(std::size_t point, const std::array<FitOutput, 3>& fits, std::array<Sheet, 3>& out,
                         double& support) const;
  [[nodiscard]] FitInput offsets(std::size_t group) const;

  const ProjectRule& rule_;
  const std::vector<Query>& queries_;
  const TileState& tile_;
  CreaseState& state_;
};

}  // namespace lamina

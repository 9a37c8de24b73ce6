// What is left out of a cloud before it is used: what lies outside a box, duplicates, outliers, more samples than
// wanted.
#pragma once
#include <cstdint>
#include <optional>
#include <string>

#include "lamina/clip.h"
#include "lamina/edit_points.h"

namespace lamina {

/// The steps are done in this order, each on what the one before has left. Lengths are in the input's units.
///
/// `merge` and `spacing` walk along the sweep axis and leave a sample out when one that stays lies within the length
/// and does not face the other way: thin sheets keep both sides. Which of several stays depends on the cloud alone; of
/// equal positions it is the first in the file.
///
/// An outlier's mean distance to its nearest `neighbours` exceeds the mean of all samples by `sigma` standard
/// deviations (Rusu et al. 2008). Neighbours are looked for as far as some dozen times the usual spacing; farther ones
/// count as if they were there, so that a few stray samples cannot raise the limit for all.
struct CleanSettings {
  RowPick pick;
  std::optional<double> merge;  ///< >= 0; 0: equal positions only (to 2^-30 of the cloud's diagonal)
  double sigma = 0;             ///< > 0; 0: outliers stay
  std::uint32_t neighbours = 16;
  double spacing = 0;  ///< > 0: least distance between samples; 0: none
  /// Steps that look at other samples.
  [[nodiscard]] bool looks_around() const { return merge.has_value() || sigma > 0 || spacing > 0; }
};

/// How many samples each step has left out.
struct CleanCounts {
  std::uint64_t clipped = 0;  ///< outside the box
  std::uint64_t skipped = 0;  ///< by RowPick::every
  std::uint64_t merged = 0, outliers = 0, thinned = 0;
  double outlier_distance = 0;  ///< mean distance to the neighbours from which on samples were outliers, input units
};

/// Throws Error(usage) for settings out of range, naming the option.
void require_sane(const CleanSettings& settings);

/// A line for the user, such as "3 duplicates merged, 17 outliers (mean distance above 0.012)"; empty when nothing was
/// left out.
std::string describe(const CleanCounts& counts);

struct CleanReport {
  CleanCounts counts;
  EditReport rows;
};

/// Writes the source's rows that stay, in their order; values are the same bits as before. Needs the memory of
/// write_point_radii() and a bit for each row; steps that look around need two to three passes over the input, and
/// temporary files in run.tmp_dir (empty: the system's). Throws Error(usage) for settings out of range, Error(empty)
/// when nothing usable is there, Error(budget) when the disk is full. Does not commit.
CleanReport clean_points(PointSource& source, PointsWriter& writer, const CleanSettings& settings, BadSamples bad,
                         const RunContext& run = {});

}  // namespace lamina

// Cleaning a cloud before it is used: samples outside a box, duplicates, outliers, and more samples than wanted are
// left out.
#pragma once
#include <cstdint>
#include <optional>
#include <string>

#include "lamina/edit.h"

namespace lamina {

/// The steps run in this order, each on what the step before has left. Lengths are in the input's units.
///
/// `merge` and `spacing` walk along the sweep axis and leave a sample out when a sample that stays lies within the
/// length and does not face the other way, so that thin sheets keep both sides. Which one stays depends on the cloud
/// alone; of equal positions it is the first in the file.
///
/// Outliers are samples whose mean distance to their nearest `neighbours` exceeds the mean of all samples by `sigma`
/// standard deviations (Rusu et al. 2008, "Towards 3D point cloud based object maps"). The search ends at about a dozen
/// times the usual spacing, and farther neighbours count as if they were there: a few stray samples cannot raise the
/// limit for all.
struct CleanSettings {
  RowPick pick;
  std::optional<double> merge;    ///< >= 0; 0: equal positions only (to 2^-30 of the cloud's diagonal)
  double sigma = 0;               ///< > 0; 0: outliers stay
  std::uint32_t neighbours = 16;  ///< 1..256, of the outlier test
  /// Samples on no surface of their neighbours are left out, by a test local to them; before, without `merge`, those at
  /// the place of another, where a look finds more than one in a hundred.
  bool strays = false;
  double spacing = 0;  ///< > 0: least distance between samples; 0: none
  /// True when a step looks at other samples: then several passes are needed.
  [[nodiscard]] bool looks_around() const { return merge.has_value() || sigma > 0 || strays || spacing > 0; }
};

/// Samples that each step has left out.
struct CleanCounts {
  std::uint64_t clipped = 0;  ///< outside the box
  std::uint64_t skipped = 0;  ///< by RowPick::every
  std::uint64_t merged = 0, outliers = 0, thinned = 0;
  std::uint64_t lonely = 0;       ///< strays far from their neighbours
  std::uint64_t off_surface = 0;  ///< strays on no surface of their neighbours
  double outlier_distance = 0;  ///< input units: samples with a larger mean distance to their neighbours were outliers
};

/// Throws Error(usage) for settings out of range, naming the option.
void require_sane(const CleanSettings& settings);

/// One line, such as "3 duplicates merged, 17 outliers (mean distance above 0.012)"; empty when nothing was left out.
std::string describe(const CleanCounts& counts);

struct CleanReport {
  CleanCounts counts;
  EditReport rows;
};

/// Writes the rows that stay, in their order, with the same bits as before. Does not commit the writer. Needs the
/// memory of write_point_radii() and one bit for each row; steps that look at other samples take two to three passes
/// over the input and temporary files in run.tmp_dir (empty: the system's). The result does not depend on threads.
/// Throws Error(usage) for settings out of range, Error(empty) when nothing usable is there, Error(unreadable) for a
/// bad row with BadSamples::refuse, Error(budget) when the disk is full, and what source and writer throw.
CleanReport clean_points(PointSource& source, PointsWriter& writer, const CleanSettings& settings, BadSamples bad,
                         const RunContext& run = {});

}  // namespace lamina

// Points without duplicates, outliers and more samples than wanted.
#pragma once
#include "lamina/clean.h"
#include "lamina/edit_points.h"

namespace lamina {

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

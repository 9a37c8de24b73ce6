// The influence radius of every point from the local sampling density: what a reconstruction would use, as a column.
#pragma once
#include <cstdint>

#include "lamina/edit_points.h"

namespace lamina {

struct PointRadiiSettings {
  std::uint32_t density = 16;  ///< samples a counting cell must hold to give a radius, 2..4096 (SurfaceSettings)
  double particlescale = 1;    ///< > 0: multiplies every radius
  double minradius = 0;        ///< input units: smaller ones become this
  double maxradius = 0;        ///< input units: larger ones become this; 0: no limit
  BadSamples bad_samples = BadSamples::drop;
  std::size_t memory = std::size_t{64} << 20;  ///< for radii on their way to their rows; at most run.max_memory / 4
};

struct PointRadiiReport {
  EditReport rows;
  double low = 0, median = 0, high = 0;   ///< 1 %, 50 %, 99 % of the radii written, within a percent
  std::uint64_t raised = 0, lowered = 0;  ///< by minradius, maxradius
};

/// Writes the source's rows in order, their `radius` (or what the writer's columns call it) estimated as
/// reconstruct_surface() does (radii.h); one that the file brings is not looked at. Normals are not needed. Three
/// passes over the input; the positions rest in a temporary file in run.tmp_dir (empty: the system's), the radii in
/// settings.memory, then in another. Threads do not change the result. Does not
/// commit.
/// Throws Error: usage (settings out of range, a writer without a radius column), empty (no points, or all of them at
/// one place), budget, and what the source throws.
PointRadiiReport write_point_radii(PointSource& source, PointsWriter& writer, const PointRadiiSettings& settings,
                                   const RunContext& run = {});

}  // namespace lamina

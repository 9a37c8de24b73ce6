// The influence radius of every point, estimated from the local sampling density: what a reconstruction would use.
#pragma once
#include <cstdint>

#include "lamina/edit.h"

namespace lamina {

/// Lengths are in the input's units.
struct PointRadiiSettings {
  std::uint32_t density = 16;  ///< samples a counting cell must hold to give a radius, 2..4096 (SurfaceSettings)
  double particlescale = 1;    ///< > 0: multiplies every radius
  double minradius = 0;        ///< >= 0: smaller radii become this
  double maxradius = 0;        ///< >= 0: larger radii become this; 0: no limit
  BadSamples bad_samples = BadSamples::drop;
  std::size_t memory = std::size_t{64} << 20;  ///< bytes for radii on the way to their rows; at most run.max_memory / 4
};

/// What was written.
struct PointRadiiReport {
  EditReport rows;
  double low = 0, median = 0, high = 0;   ///< 1 %, 50 % and 99 % quantiles of the radii written, within a percent
  std::uint64_t raised = 0, lowered = 0;  ///< radii changed by minradius and maxradius
};

/// Writes the source's rows in order with a `radius` (or what the writer's columns call it) estimated as
/// reconstruct_surface() does (Cuccuru et al. 2009, section 3.1): r = 2 sqrt(A / N) of the finest octree cell with at
/// least `density` samples N, A the area of its side, bounded by the cells around. Radii in the input are ignored, and
/// normals are not needed. Does not commit the writer. Takes three passes over the input; positions lie in a temporary
/// file in run.tmp_dir (empty: the system's), and so do radii beyond settings.memory. The result does not depend on
/// threads.
/// Throws Error: usage (settings out of range, a writer without a radius column), empty (no points, or all at one
/// place), budget (memory, disk), and what source and writer throw.
PointRadiiReport write_point_radii(PointSource& source, PointsWriter& writer, const PointRadiiSettings& settings,
                                   const RunContext& run = {});

}  // namespace lamina

// The samples that cleaning leaves out, as a point file beside the mesh.
#pragma once
#include <memory>

#include "lamina/points.h"
#include "lamina/surface.h"
#include "reconstruct/stored_cloud.h"
#include "samples/outliers.h"

namespace lamina {

/// Throws Error: usage for a name that says no format, budget for a file that cannot be written.
void try_rejected(const SurfaceSettings& settings);

/// Opens the file for samples of the cloud. Throws Error(usage) where their attributes have one called `reason`
/// already, and what open_points_writer() throws.
std::unique_ptr<PointsWriter> open_rejected(const StoredCloud& cloud, const SurfaceSettings& settings);

/// Appends the samples that have a reason: buckets along the sweep axis, in each the input's order.
void write_rejected(const StoredCloud& cloud, const Reasons& reasons, PointsWriter& writer);

}  // namespace lamina

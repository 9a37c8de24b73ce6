// Volumes clipped, moved, turned and scaled: .vdb files in, .vdb files out.
#pragma once
#include <Eigen/Geometry>
#include <cstdint>
#include <string>

#include "lamina/clip.h"
#include "lamina/run.h"

namespace lamina {

struct VolumeEditStats {
  std::uint64_t grids = 0, voxels = 0, points = 0, bytes = 0;  ///< as written
};

/// Keeps the voxels whose middle lies in the region (or outside), and the points; nothing is resampled. A level set
/// that loses voxels is open from then on: it ends at the cut, as a mesh does, and only the places beside its voxels
/// have a side. Grids of which nothing is left are left out. Held in memory; "-" is standard output. The bytes are the
/// same for any number of threads. Throws Error: unreadable (the input), usage (clip.h's require_sane(); a grid of a
/// type that cannot be clipped, naming it), empty (nothing left), budget (the output cannot be written).
VolumeEditStats clip_volume(const std::string& input, const ClipRegion& region, Keep keep, const std::string& output,
                            const RunContext& run = {});

/// Moves the grids by their transforms; no voxel is resampled. A level set's distances and band grow with the scale,
/// vectors turn as their grid's vector type says (`N` by the inverse transpose, of length 1), points move themselves.
/// Held in memory; "-" is standard output.
/// Throws Error: unreadable (the input; a frustum transform), usage (a level set that would be stretched or sheared:
/// its values would be no distances any more), budget (the output cannot be written).
VolumeEditStats transform_volume(const std::string& input, const Eigen::Affine3d& transform, const std::string& output,
                                 const RunContext& run = {});

}  // namespace lamina

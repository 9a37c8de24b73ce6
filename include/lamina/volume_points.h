// Point clouds as OpenVDB points grids, and back.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/run.h"

namespace lamina {

/// A whole cloud in memory: the arrays, and the names and types of `samples.attributes`.
struct PointArrays {
  SampleBatch samples;
  AttributeLayout layout;
};

/// How points are written.
struct PointVolumeSettings {
  std::string name = "points";
  /// Edge of a voxel, world units, rounded down to a power of two, 2^-16 at least; 0: for about eight points a voxel.
  double voxel = 0;
};

/// What was written.
struct PointVolumeStats {
  std::uint64_t points = 0, voxels = 0, bytes = 0;
  double voxel = 0;  ///< as written
};

/// Writes one points grid with `P`, `N`, `pscale` (radius), `quality`, `Cd` (red green blue, 0..1), `Alpha`, and every
/// other attribute by its name as float or int32; metadata keep the types they came in. Positions that are floats read
/// back as the same bits, doubles within 2^-25 of a voxel: the voxel is a power of two, and the transform holds the
/// offset of georeferenced coordinates. Points are ordered by voxel, then as they came. The bytes are the same for any
/// number of threads. "-" is standard output. Throws Error: usage (settings; arrays of unequal length; an attribute's
/// name twice), empty (no points), unreadable (a coordinate that is not finite, naming the row), budget (cannot be
/// written).
PointVolumeStats write_point_volume(const PointArrays& points, const PointVolumeSettings& settings,
                                    const std::string& path, const RunContext& run = {});

/// What was read.
struct PointVolume {
  PointArrays points;
  std::vector<std::string> skipped;  ///< attributes of other types: text, matrices, groups, arrays
};

/// Reads the points grid `name`, or the first of the file where that is empty: `P` in any precision or compression,
/// `N`, `pscale` or `radius`, `quality` or `confidence`. `Cd` becomes red, green, blue (in the type it was written
/// from, else float 0..1), and another vector V becomes V_x, V_y, V_z. Throws Error(unreadable) naming the file and
/// what is wrong.
PointVolume read_point_volume(const std::string& path, const std::string& name = {});

}  // namespace lamina

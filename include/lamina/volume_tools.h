// Volumes clipped, moved, joined and described: .vdb files in, .vdb files out.
#pragma once
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

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

struct VolumeMergeStats {
  std::uint64_t grids = 0, voxels = 0, points = 0, bytes = 0;
};

/// Grids of the same name become one, others stand beside each other. Level sets are united: closed ones as solids,
/// open ones (and the files of a sequence that `surface` split) voxel by voxel, the nearer distance where both have
/// one, and the sides of the tiles between them decided anew. Of other grids the first file's voxel counts where
/// several have it. Points are put together with the attributes of all; what a file lacks is 0 there, and a warning
/// says so. The whole result is held in memory. The bytes are the same for any number of threads; "-" is standard
/// output. Throws Error: unreadable (an input), usage (no inputs; grids of one name that differ in type, class,
/// transform or band, naming both files), budget (the output cannot be written).
VolumeMergeStats merge_volumes(const std::vector<std::string>& inputs, const std::string& output,
                               const RunContext& run = {});

struct GridInfo {
  std::string name;
  std::string type;        ///< "float", "double", "vec3s", "ptdataidx32" (points), ... as OpenVDB calls it
  std::string grid_class;  ///< "level set", "fog volume", "staggered", "unknown"
  std::string creator;
  std::string background;  ///< in words
  bool half = false;       ///< stored as 16-bit floats
  bool points = false;     ///< a points grid; `point_count` and `attributes` are filled
  bool open = false;       ///< level set whose band exists only near data
  std::uint64_t active_voxels = 0, active_tiles = 0;
  std::uint64_t leaf_nodes = 0, internal_nodes = 0;
  std::uint64_t memory_bytes = 0;  ///< of the tree
  double leaf_fill = 0;            ///< mean share of active voxels in a leaf, 0..1
  /// Smallest box around the active voxels, inclusive; high < low when there are none.
  std::array<std::int32_t, 3> index_low{0, 0, 0}, index_high{-1, -1, -1};
  std::array<double, 3> world_low{}, world_high{};  ///< box around those voxels' centres, world units
  std::array<double, 3> voxel{};                    ///< edges of a voxel, world units
  std::string transform_type;                       ///< "uniform scale", "affine", "frustum", ...
  bool uniform = false;                             ///< voxels are cubes
  bool linear = true;                               ///< false: frustum (perspective); `index_to_world` is identity then
  std::array<std::array<double, 4>, 4> index_to_world{};  ///< rows; world = M * (i, j, k, 1)
  double value_low = 0, value_high = 0;                   ///< of active values; 0 where there are none, or not scalar
  std::uint64_t point_count = 0;
  std::vector<std::pair<std::string, std::string>> attributes;  ///< of points: name and type
  std::vector<std::pair<std::string, std::string>> metadata;    ///< name and value in words, by name
};

struct VolumeInfo {
  std::string path;
  std::string version;  ///< of the format: library.file, such as "10.0/224"
  std::uint64_t bytes = 0;
  std::vector<GridInfo> grids;  ///< in the order of their names
};

/// Reads the whole file. Throws Error(unreadable) naming the file and what is wrong: missing, truncated, not a .vdb, no
/// grids.
VolumeInfo describe_volume(const std::string& path);

}  // namespace lamina

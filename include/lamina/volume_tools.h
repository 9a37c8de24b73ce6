// Volumes clipped, moved, merged and described: from .vdb files to .vdb files; and the voxels of
// grids as plain arrays.
#pragma once
#include <Eigen/Geometry>

#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "lamina/edit.h"
#include "lamina/run.h"
#include "lamina/volume.h"

namespace lamina {

/// What was written.
struct VolumeEditStats {
  std::uint64_t grids = 0, voxels = 0, points = 0, bytes = 0;  ///< as written
};

/// Keeps the voxels whose centre lies inside the region (or outside), and points likewise; nothing is resampled. A
/// level set that loses voxels becomes open: it ends at the cut, as a mesh does, and is neither inside nor outside
/// beyond its band. Grids without anything left are dropped. The file is held in memory; "-" is standard output. The
/// bytes are the same for any number of threads. Throws Error: unreadable (the input), usage (lamina/edit.h's
/// require_sane(); a grid of a type that cannot be clipped, naming it), empty (nothing left), budget (the output cannot
/// be written).
VolumeEditStats clip_volume(const std::string& input, const ClipRegion& region, Keep keep, const std::string& output,
                            const RunContext& run = {});

/// Moves the grids by changing their transforms; no voxel is resampled. Distances and band of a level set grow with the
/// scale, vectors turn as the vector type of their grid says (`N` by the inverse transpose, to length 1), and points
/// move. The file is held in memory; "-" is standard output. Throws Error: unreadable (the input; a frustum transform),
/// usage (a level set that would be stretched or sheared: its values would no longer be distances), budget (the output
/// cannot be written).
VolumeEditStats transform_volume(const std::string& input, const Eigen::Affine3d& transform, const std::string& output,
                                 const RunContext& run = {});

struct VolumeMergeStats {
  std::uint64_t grids = 0, voxels = 0, points = 0, bytes = 0;
};

/// Merges grids of the same name and keeps the others side by side. Closed level sets are united as solids; open ones,
/// and the files of a sequence that `surface` split, voxel by voxel: the nearer distance counts, and the tiles between
/// are decided anew to be inside or outside. In other grids the first file with a voxel counts. Points get the
/// attributes of all files; where a file lacks one it is 0, and a warning says so. The result is held in memory; "-" is
/// standard output. The bytes are the same for any number of threads. Throws Error: unreadable (an input), usage (no
/// inputs; grids of one name that differ in type, class, transform or band, naming both files), budget (the output
/// cannot be written).
VolumeMergeStats merge_volumes(const std::vector<std::string>& inputs, const std::string& output,
                               const RunContext& run = {});

/// One grid of a file.
struct GridInfo {
  std::string name;
  std::string type;        ///< "float", "double", "vec3s", "ptdataidx32" (points), ... as OpenVDB calls it
  std::string grid_class;  ///< "level set", "fog volume", "staggered", "unknown"
  std::string creator;
  std::string background;  ///< as text
  bool half = false;       ///< stored as 16-bit floats
  bool points = false;     ///< a points grid; `point_count` and `attributes` are filled
  bool open = false;       ///< a level set whose band exists only near data
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
  double value_low = 0, value_high = 0;                   ///< of active values; 0 where there are none, or no scalars
  std::uint64_t point_count = 0;
  std::vector<std::pair<std::string, std::string>> attributes;  ///< of points: names and types
  std::vector<std::pair<std::string, std::string>> metadata;    ///< names and values as text, by name
};

/// All grids of a file.
struct VolumeInfo {
  std::string path;
  std::string version;  ///< of the format: library.file, such as "10.0/224"
  std::uint64_t bytes = 0;
  std::vector<GridInfo> grids;  ///< in the order of their names
};

/// Describes a .vdb file, reading all of it. Throws Error(unreadable) naming the file and what is wrong: missing,
/// truncated, not a .vdb, no grids.
VolumeInfo describe_volume(const std::string& path);

// The voxels of a grid as plain arrays, for programs that do not know OpenVDB.

/// Every voxel of the box around a grid's active ones.
struct DenseVoxels {
  std::array<double, 3> origin{};  ///< centre of the first voxel, world units
  double edge = 0;                 ///< of a voxel
  std::array<std::int64_t, 3> size{};
  std::vector<float> values;  ///< z runs fastest: the voxel i j k is at (i * size[1] + j) * size[2] + k
};

/// The active voxels alone.
struct SparseVoxels {
  std::array<double, 3> origin{};  ///< centre of the voxel 0 0 0
  double edge = 0;
  std::vector<std::array<std::int32_t, 3>> indices;
  std::vector<float> values;  ///< one for each
};

/// Voxels that are not active have the grid's background, negative inside of a level set. Throws Error(usage) where
/// voxels are no cubes along the axes, Error(budget) where the box needs more memory than run.max_memory, or without a
/// limit, than the machine has; Error(internal) when cancelled.
DenseVoxels dense_voxels(const LevelSet& level_set, const RunContext& run = {});
DenseVoxels dense_voxels(const FogVolume& fog, const RunContext& run = {});

/// Active tiles of a fog come as their voxels. Throws likewise.
SparseVoxels sparse_voxels(const LevelSet& level_set, const RunContext& run = {});
SparseVoxels sparse_voxels(const FogVolume& fog, const RunContext& run = {});

}  // namespace lamina

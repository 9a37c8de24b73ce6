// What is inside a .vdb file.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace lamina {

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

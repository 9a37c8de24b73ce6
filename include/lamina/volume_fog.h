// Fog volumes: densities in voxels.
#pragma once
#include <memory>
#include <string>

namespace lamina {

/// Densities (an OpenVDB float grid), held in memory. Cheap to copy; never changed.
class FogVolume {
 public:
  struct Data;  ///< keeps openvdb.h out of this header
  explicit FogVolume(std::shared_ptr<const Data> data);

  [[nodiscard]] const std::string& name() const;  ///< of the grid
  [[nodiscard]] double voxel() const;             ///< the shortest edge of a voxel, world units
  [[nodiscard]] const Data& data() const { return *data_; }

 private:
  std::shared_ptr<const Data> data_;
};

/// Reads the fog called `name`; with an empty name the one called `density`, else the file's first. Named, a float grid
/// of any class but a level set will do. Double grids are rounded to float; any linear transform is taken as it is.
/// Throws Error(unreadable) naming the file and what is there: missing, truncated, not a .vdb, no fog, no grid of that
/// name, a level set, points, vectors, a frustum (perspective) transform, no active voxels.
FogVolume read_fog(const std::string& path, const std::string& name = {});

}  // namespace lamina

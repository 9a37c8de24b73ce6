// What a LevelSet (volume.h) holds.
#pragma once
#include "lamina/volume.h"
#include "vdb/grids.h"

namespace lamina {

struct LevelSet::Data {
  openvdb::FloatGrid::ConstPtr grid;
  openvdb::Vec3SGrid::ConstPtr colours;  ///< the file's grid Cd, sRGB in 0..1; null where there is none
  std::string name;
  std::string path;  ///< it came from, for messages; may be empty
  bool open = false;
};

}  // namespace lamina

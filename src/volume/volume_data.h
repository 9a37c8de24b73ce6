// What a LevelSet and a FogVolume (volume.h) hold, and how the inside of an open level set is told before it becomes
// fog.
#pragma once
#include <string>

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

struct FogVolume::Data {
  openvdb::FloatGrid::ConstPtr grid;
  openvdb::Vec3SGrid::ConstPtr colours;  ///< the file's grid Cd, sRGB in 0..1; null where there is none
  std::string name;
};

}  // namespace lamina
namespace lamina::volume {

/// Gives the voxels and tiles beyond the band that count as inside, and are connected there with the outside, the
/// outside's value. Leaves of the band bring their sign to all of their voxels, and to a tile or two behind them
/// (tile_signs.h); where the surface is open that is an inside of eight voxels' steps. What the band encloses stays.
void empty_open_inside(openvdb::FloatGrid& grid);

}  // namespace lamina::volume

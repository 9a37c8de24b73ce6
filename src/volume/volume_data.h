// What a LevelSet and a FogVolume (volume.h) hold, the band of a mesh, and how the inside of an open level set is told
// before it becomes fog.
#pragma once
#include <string>

#include "lamina/mesh.h"
#include "lamina/run.h"
#include "lamina/volume.h"
#include "measure/triangle_bvh.h"
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
/// (TileSigns); where the surface is open that is an inside of eight voxels' steps. What the band encloses stays.
void empty_open_inside(openvdb::FloatGrid& grid);

// The band of distances around a mesh, and the colours in it.

/// Distances in mesh units, active nearer than `band` voxels; negative inside where `has_sign`. Throws
/// Error(internal) when cancelled.
openvdb::FloatGrid::Ptr distance_grid(const TriangleMesh& mesh, const measure::TriangleBvh& triangles,
                                      const openvdb::math::Transform& transform, double band, bool has_sign,
                                      const RunContext& run);

/// The colour of the nearest point of the mesh for every active voxel of `distances`, in 0..1; null when the mesh has
/// no colours.
openvdb::Vec3SGrid::Ptr colour_grid(const TriangleMesh& mesh, const measure::TriangleBvh& triangles,
                                    const openvdb::FloatGrid& distances);

}  // namespace lamina::volume

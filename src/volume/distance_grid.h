// The band of distances around a mesh, and the colours in it.
#pragma once

#include "lamina/mesh.h"
#include "lamina/run.h"
#include "measure/triangle_bvh.h"
#include "vdb/grids.h"

namespace lamina::volume {

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

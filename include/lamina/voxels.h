// The voxels of a grid as plain arrays, for programs that do not know OpenVDB.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "lamina/run.h"
#include "lamina/volume.h"

namespace lamina {

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

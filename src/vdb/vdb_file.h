// Whole .vdb files in memory.
#pragma once

#include <array>
#include <functional>
#include <string>

#include "vdb/grids.h"

namespace lamina::volume {

struct VdbFile {
  openvdb::GridPtrVec grids;  ///< in the order of their names
  std::string version;        ///< library.file
  std::uint64_t bytes = 0;
};

/// Throws Error(unreadable) naming the file and what is wrong: missing, truncated, not a .vdb, no grids.
VdbFile read_vdb(const std::string& path);

/// What a grid is, for messages: "a level set", "points", "a fog volume", "vec3s values".
std::string kind_of(const openvdb::GridBase& grid);

/// "surface (a level set), Cd (vec3s values)".
std::string list_of(const openvdb::GridPtrVec& grids);

/// The grid called `name` or, where that is empty, the fittest: the largest fitness(grid, false). It must be fit,
/// linear and not empty; a named one must have fitness(grid, true) > 0. `wanted`: a word for such grids. Throws
/// Error(unreadable).
openvdb::GridBase::Ptr choose_grid(const std::string& path, const openvdb::GridPtrVec& grids, const std::string& name,
                                   const std::string& wanted,
                                   const std::function<int(const openvdb::GridBase&, bool)>& fitness);
/// Float or double.
bool is_scalar(const openvdb::GridBase& grid);

/// A float or double grid as floats; null when it is neither.
openvdb::FloatGrid::Ptr as_float(const openvdb::GridBase::Ptr& grid);

/// The colours among the grids, `Cd`; null where there are none.
openvdb::Vec3SGrid::ConstPtr colours_of(const openvdb::GridPtrVec& grids);

/// The metadata that says where a level set is known.
inline constexpr const char* kOpenMetadata = "open";
bool is_open(const openvdb::GridBase& grid);

/// Name, creator and precision of a grid about to be written.
void label(openvdb::GridBase& grid, const std::string& name, bool half);
/// Metadata `shift`: what to add to the grid's coordinates to get the input's.
void note_shift(openvdb::GridBase& grid, const std::array<double, 3>& shift);

/// Writes the grids beside `path`, then renames; "-" is standard output. Returns the size in bytes.
std::uint64_t write_vdb(const openvdb::GridCPtrVec& grids, const std::string& path);

}  // namespace lamina::volume

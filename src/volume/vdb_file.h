// Whole .vdb files in memory.
#pragma once
#include <openvdb/openvdb.h>

#include <array>
#include <string>

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

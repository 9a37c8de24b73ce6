// Level sets read from .vdb files, and what they are turned into: a mesh, a fog.
#pragma once
#include <memory>
#include <string>

#include "lamina/mesh.h"
#include "lamina/run.h"

namespace lamina {

/// Signed distances in a narrow band (an OpenVDB float grid), held in memory. Cheap to copy; never changed.
class LevelSet {
 public:
  struct Data;  ///< keeps openvdb.h out of this header
  explicit LevelSet(std::shared_ptr<const Data> data);

  [[nodiscard]] const std::string& name() const;  ///< of the grid
  [[nodiscard]] double voxel() const;             ///< the shortest edge of a voxel, world units
  [[nodiscard]] double band() const;              ///< half width of the band, world units: the grid's background
  [[nodiscard]] bool open() const;                ///< the band exists only near data (grid metadata `open`)
  [[nodiscard]] const Data& data() const { return *data_; }

 private:
  std::shared_ptr<const Data> data_;
};

/// Reads the level set called `name`; with an empty name the one called `surface`, else the file's first. A float grid
/// of no class counts when nothing better is there. Double grids are rounded to float. Rotated, sheared and
/// non-uniform transforms are taken as they are.
/// Throws Error(unreadable) naming the file and what is there: missing, truncated, not a .vdb, no grids, no grid of
/// that name, a fog volume, points, vectors, a frustum (perspective) transform.
LevelSet read_level_set(const std::string& path, const std::string& name = {});

struct MeshingSettings {
  double adaptivity = 0;  ///< 0..1: how far flat parts may be simplified into larger polygons; 0: one size everywhere
  double isovalue = 0;    ///< distance at which to mesh, world units, inside the band
};

/// The isosurface in world coordinates (doubles), by OpenVDB's dual mesher; quads are split along the shorter diagonal,
/// triangles wind counter-clockwise seen from outside. A closed level set gives a closed manifold mesh when adaptivity
/// is 0; with adaptivity OpenVDB's polygons may leave single edges with four triangles.
/// Throws Error: usage (a setting out of range), empty (no surface at that distance).
TriangleMesh mesh_level_set(const LevelSet& level_set, const MeshingSettings& settings = {},
                            const RunContext& run = {});

struct FogSettings {
  std::string name = "density";
  double ramp = 0;    ///< world units from the surface to full density, inside; 0: the whole band
  bool half = false;  ///< store 16-bit floats
};

/// Writes the inside as a fog volume: density 0 at the surface, rising to 1 over the ramp. An open level set (see
/// LevelSet::open) is filled as far as its tiles are known to be inside. "-" is standard output. The same bytes for any
/// number of threads. Throws Error: usage (no name, a negative ramp), empty (nothing inside), budget (cannot be
/// written). Returns the file's size in bytes.
std::uint64_t write_fog(const LevelSet& level_set, const FogSettings& settings, const std::string& path,
                        const RunContext& run = {});

}  // namespace lamina

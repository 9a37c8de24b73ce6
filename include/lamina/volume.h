// Level sets and fogs: from a mesh to a narrow-band level set in a .vdb file, and from .vdb files to meshes and fogs.
#pragma once
#include <cstdint>
#include <memory>
#include <string>

#include "lamina/mesh.h"
#include "lamina/run.h"

namespace lamina {

/// What the distances' sign says.
enum class VolumeSign {
  automatic,  ///< closed meshes get `inside`, meshes with a boundary `none`
  inside,     ///< negative inside: a level set. Regions that a hole connects with the outside are outside
  none,       ///< distances only
};

struct VolumeSettings {
  double voxel = 0;  ///< edge of a voxel, mesh units; 0: the mean length of the mesh's edges
  double band = 3;   ///< half width of the band that holds distances, voxels, 1..1000
  VolumeSign sign = VolumeSign::automatic;
  std::string name = "surface";  ///< of the distance grid; colours are always `Cd`
  bool colours = true;           ///< write `Cd` when the mesh has red, green, blue
  bool half = false;             ///< store 16-bit floats: half the file, 11 bits of precision
};

struct VolumeStats {
  double voxel = 0;                  ///< mesh units
  std::uint64_t boundary_edges = 0;  ///< edges of one triangle: the mesh is closed when there are none
  bool has_sign = false;
  std::uint64_t voxels = 0;  ///< in the band
  bool has_colours = false;
  std::uint64_t bytes = 0;  ///< of the file
};

/// Writes grids in the mesh's own coordinates; the voxels lie on multiples of their edge, so that files of the same
/// voxel size fit together. Every voxel nearer to a triangle than the band is wide holds the exact distance to the
/// nearest triangle; `Cd` there holds the colour of the nearest point, in 0..1. The bytes are the same for any number
/// of threads. "-" is standard output; a file is written beside `path` and renamed.
/// Throws Error: unreadable (no triangles), usage (a setting out of range, a voxel too small for the coordinates),
/// budget (more memory than run.max_memory, or the file cannot be written), empty (no area), internal (cancelled).
VolumeStats write_volume(const TriangleMesh& mesh, const VolumeSettings& settings, const std::string& path,
                         const RunContext& run = {});

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

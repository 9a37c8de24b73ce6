// Level sets and fogs: from a mesh to a narrow-band level set in a .vdb file, and from .vdb files to meshes and fogs.
#pragma once
#include <cstdint>
#include <memory>
#include <string>

#include "lamina/mesh.h"
#include "lamina/run.h"

namespace lamina {

/// What the sign of the distances says.
enum class VolumeSign {
  automatic,  ///< closed meshes get `inside`, meshes with a boundary `none`
  inside,     ///< negative inside: a level set. Regions that a hole connects to the outside are outside
  none,       ///< distances only
};

/// How a mesh becomes a volume.
struct VolumeSettings {
  double voxel = 0;  ///< edge of a voxel, mesh units; 0: the mean length of the edges of the mesh
  double band = 3;   ///< half width of the band that holds distances, voxels, 1..1000
  VolumeSign sign = VolumeSign::automatic;
  std::string name = "surface";  ///< of the grid of distances; colours are always `Cd`
  bool colours = true;           ///< write `Cd` when the mesh has red, green, blue
  bool half = false;             ///< store 16-bit floats: half the file, 11 bits of precision
};

/// What was written.
struct VolumeStats {
  double voxel = 0;                  ///< mesh units
  std::uint64_t boundary_edges = 0;  ///< edges of one triangle: the mesh is closed when there are none
  bool has_sign = false;
  std::uint64_t voxels = 0;  ///< in the band
  bool has_colours = false;
  std::uint64_t bytes = 0;  ///< of the file
};

/// Writes a mesh as OpenVDB grids in its own coordinates. Voxels lie on multiples of their edge, so that files of one
/// voxel size fit together. Every voxel nearer to the surface than the band's half width holds the exact distance to
/// the nearest triangle, and in `Cd` the colour of the nearest point, 0..1. The bytes are the same for any number of
/// threads. "-" is standard output; a file appears under its name when it is complete. Throws Error: unreadable (no
/// triangles), usage (a setting out of range, a voxel too small for the coordinates), budget (more memory than
/// run.max_memory, or the file cannot be written), empty (no area), internal (cancelled).
VolumeStats write_volume(const TriangleMesh& mesh, const VolumeSettings& settings, const std::string& path,
                         const RunContext& run = {});

/// Signed distances in a narrow band (an OpenVDB float grid), held in memory. Immutable and cheap to copy.
class LevelSet {
 public:
  struct Data;  ///< keeps openvdb.h out of this header
  explicit LevelSet(std::shared_ptr<const Data> data);

  [[nodiscard]] const std::string& name() const;  ///< of the grid
  [[nodiscard]] double voxel() const;             ///< shortest edge of a voxel, world units
  [[nodiscard]] double band() const;              ///< half width of the band, world units: the background of the grid
  [[nodiscard]] bool open() const;                ///< the band exists only near data (grid metadata `open`)
  [[nodiscard]] const Data& data() const { return *data_; }

 private:
  std::shared_ptr<const Data> data_;
};

/// Reads the level set `name`; with an empty name the one called `surface`, else the first of the file. A float grid of
/// no class is taken where there is nothing better. Double grids are rounded to float. Rotated, sheared and non-uniform
/// transforms are kept.
/// Throws Error(unreadable) naming the file and what is there: missing, truncated, not a .vdb, no grids, no grid of
/// that name, a fog volume, points, vectors, a frustum (perspective) transform.
LevelSet read_level_set(const std::string& path, const std::string& name = {});

/// How a level set becomes a mesh.
struct MeshingSettings {
  double adaptivity = 0;  ///< 0..1: how far flat parts are simplified into larger polygons; 0: not at all
  double isovalue = 0;    ///< the distance to mesh, world units, inside the band
};

/// The isosurface in world coordinates, by OpenVDB's dual mesher. Quads are split along the shorter diagonal; triangles
/// run counter-clockwise seen from outside. With adaptivity 0 a closed level set gives a closed manifold mesh; above,
/// OpenVDB's polygons may leave single edges with four triangles. Throws Error: usage (a setting out of range), empty
/// (no surface at that distance).
TriangleMesh mesh_level_set(const LevelSet& level_set, const MeshingSettings& settings = {},
                            const RunContext& run = {});

/// How a level set becomes a fog.
struct FogSettings {
  std::string name = "density";
  double ramp = 0;    ///< world units inwards from the surface to density 1; 0: the half width of the band
  bool half = false;  ///< store 16-bit floats
};

/// Writes the inside as a fog volume: density 0 at the surface, rising to 1 over the ramp. An open level set
/// (LevelSet::open) is filled as far as its tiles are known to be inside. "-" is standard output. The bytes are the
/// same for any number of threads. Throws Error: usage (no name, a negative ramp), empty (nothing inside), budget
/// (cannot be written). Returns the file's size in bytes.
std::uint64_t write_fog(const LevelSet& level_set, const FogSettings& settings, const std::string& path,
                        const RunContext& run = {});

/// Densities (an OpenVDB float grid), held in memory. Immutable and cheap to copy.
class FogVolume {
 public:
  struct Data;  ///< keeps openvdb.h out of this header
  explicit FogVolume(std::shared_ptr<const Data> data);

  [[nodiscard]] const std::string& name() const;  ///< of the grid
  [[nodiscard]] double voxel() const;             ///< shortest edge of a voxel, world units
  [[nodiscard]] const Data& data() const { return *data_; }

 private:
  std::shared_ptr<const Data> data_;
};

/// Reads the fog `name`, a float grid of any class but level set; with an empty name the fog called `density`, else the
/// first of the file. Double grids are rounded to float; any linear transform is kept.
/// Throws Error(unreadable) naming the file and what is there: missing, truncated, not a .vdb, no fog, no grid of that
/// name, a level set, points, vectors, a frustum (perspective) transform, no active voxels.
FogVolume read_fog(const std::string& path, const std::string& name = {});

}  // namespace lamina

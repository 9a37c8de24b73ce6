// From a mesh to an OpenVDB file: a narrow-band level set, and the mesh's colours around the surface.
#pragma once
#include <cstdint>
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

}  // namespace lamina

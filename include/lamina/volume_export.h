// What `surface` writes as OpenVDB grids beside its mesh.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace lamina {

/// The signed distance that the mesh is extracted from: a level set `surface` in the input's frame, positive outside,
/// world units. It exists only near data (metadata `open`, and the class level set); the background is the band's
/// width.
struct VolumeExport {
  std::string path;  ///< .vdb to write; empty: none
  /// Further grids over the same voxels: N (unit normals), Cd (colours, 0..1), weight (1 where the surface point lies
  /// in the middle of its samples, falling to 0 where it is extended from neighbours), curvature (1/world units,
  /// positive where convex), or any attribute of the points by its name. Unset: Cd where the points have colours.
  std::vector<std::string> grids{kColours};
  bool half = true;  ///< store 16-bit floats: 11 bits, of distances inside the band
  double band = 3;   ///< half width of the band, voxels, 1..8
  bool levels =
      false;         ///< one grid per level of the octree (surface_L0 the finest) with what was projected there alone
  double voxel = 0;  ///< the nearest cell size of the octree is taken, refused where twice beyond all; 0: of most cells
  std::size_t split = 0;  ///< bytes of voxels in memory at which a new file begins: OUT.0001.vdb ...; 0: one file
  std::string points;     ///< .vdb for the projected corners as points: P, N, Cd, pscale; empty: none
  std::size_t points_per_file = 1 << 20;  ///< beyond, a numbered sequence

  std::optional<std::array<double, 3>> shift{};  ///< written to the grids' metadata `shift`: add it to coordinates

  static constexpr const char* kColours = "auto";
  [[nodiscard]] bool wanted() const { return !path.empty() || !points.empty(); }
};

struct VolumeExportStats {
  double voxel = 0;          ///< edge, world units
  std::uint64_t voxels = 0;  ///< active, of all `surface` grids
  std::uint64_t points = 0;
  std::uint64_t bytes = 0;  ///< of all files
  std::vector<std::string> files;
};

}  // namespace lamina

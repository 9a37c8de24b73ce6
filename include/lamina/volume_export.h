// The OpenVDB grids that a reconstruction writes beside its mesh.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace lamina {

/// The signed distances that the mesh is extracted from, as a level set `surface` in the input's coordinates and units,
/// positive outside. It exists only near data (grid class level set, metadata `open`); the background is the half width
/// of the band.
struct VolumeExport {
  std::string path;  ///< .vdb to write; empty: none
  /// Further grids over the same voxels: N (unit normals), Cd (colours, 0..1), weight (1 where the surface point lies
  /// amid its samples, down to 0 where it is extended from neighbours), curvature (1 / input unit, positive where
  /// convex), or any attribute of the points by its name. kColours stands for Cd where the points have colours.
  std::vector<std::string> grids{kColours};
  bool half = true;     ///< store 16-bit floats, of 11 bits
  double band = 3;      ///< half width of the band, voxels, 1..8
  bool levels = false;  ///< one grid for each octree level (surface_L0 the finest) with only what was projected there
  /// Input units: the nearest cell size of the octree is taken; refused more than twice beyond all. 0: that of most
  /// cells.
  double voxel = 0;
  std::size_t split = 0;  ///< bytes of voxels in memory after which a new file begins: OUT.0001.vdb ...; 0: one file
  std::string points;     ///< .vdb for the projected corners as points: P, N, Cd, pscale; empty: none
  std::size_t points_per_file = 1 << 20;  ///< > 0; more points become a numbered sequence of files

  std::optional<std::array<double, 3>> shift{};  ///< to add to coordinates; written as the metadata `shift`
  std::string crs{};                             ///< PointSourceInfo::crs; written as the metadata `crs`

  static constexpr const char* kColours = "auto";
  /// True when anything is to be written.
  [[nodiscard]] bool wanted() const { return !path.empty() || !points.empty(); }
};

/// What was written.
struct VolumeExportStats {
  double voxel = 0;          ///< edge, input units
  std::uint64_t voxels = 0;  ///< active, of all `surface` grids
  std::uint64_t points = 0;
  std::uint64_t bytes = 0;  ///< of all files
  std::vector<std::string> files;
};

}  // namespace lamina

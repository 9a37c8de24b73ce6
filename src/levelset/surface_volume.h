// The grids of a running reconstruction, taken slab by slab and written to .vdb files.
#pragma once
#include <cstdint>
#include <memory>

#include "isosurface/iso_mesh.h"
#include "lamina/attributes.h"
#include "lamina/frame.h"
#include "lamina/volume_export.h"
#include "octree/window.h"

namespace lamina {

/// Throws Error(usage) for settings out of range.
void check_volume_export(const VolumeExport& settings);

/// The level whose corners become voxels: the one with most cells, or whose cells are nearest to the voxel asked for.
/// `step`: of the frame. Throws Error(usage) where it is more than twice as large or small as all cells.
int volume_level(const VolumeExport& settings, double step, const Lattice& lattice, int main_level);

class SurfaceVolume {
 public:
  /// `main_level`: the lattice's level with most cells. Throws Error: usage (a grid nobody knows, a voxel too small),
  /// budget (an output that cannot be written).
  SurfaceVolume(const VolumeExport& settings, const Frame& frame, const Lattice& lattice, int main_level,
                const AttributeLayout& layout, const std::string& tmp_dir);
  ~SurfaceVolume();
  SurfaceVolume(const SurfaceVolume&) = delete;
  SurfaceVolume& operator=(const SurfaceVolume&) = delete;

  /// The next slab: its corners, and those of the slabs below and above, must be finished and still have their values.
  void add(const Window& window, const IsoSlab& slab, std::int32_t number);
  /// Puts the files together. `open`: the surface has a boundary.
  void finish(bool open);
  /// They appear under their names.
  void commit();
  [[nodiscard]] const VolumeExportStats& stats() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace lamina

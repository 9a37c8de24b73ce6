// The projected corners next to the surface, as points: where the mesh's vertices are taken from.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/output_file.h"
#include "isosurface/iso_mesh.h"
#include "lamina/frame.h"
#include "lamina/volume_export.h"
#include "lamina/volume_points.h"

namespace lamina::volume {

/// A points grid needs all of its points at once: beyond VolumeExport::points_per_file a numbered sequence is begun.
class CornerPoints {
 public:
  CornerPoints(const VolumeExport& settings, const AttributeLayout& layout, const Frame& frame);
  void add(const IsoSlab& slab);
  void finish();
  /// The names the files appear under.
  std::vector<std::string> commit();
  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }

 private:
  void write_file();

  std::string path_;
  std::size_t per_file_;
  Frame frame_;
  std::optional<std::array<double, 3>> shift_;
  std::string crs_;
  PointArrays points_;
  std::vector<std::unique_ptr<ResultFile>> files_;
  std::uint64_t count_ = 0, bytes_ = 0;
};

}  // namespace lamina::volume

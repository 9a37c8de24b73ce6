// The rays of a picture through a grid, in the grid's index space, and the colours of the grid beside it in its file.
#pragma once
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <optional>

#include "render/canvas.h"
#include "vdb/grids.h"

namespace lamina::render_detail {

inline openvdb::Vec3d to_vdb(const Eigen::Vector3d& v) {
  return {v[0], v[1], v[2]};
}

/// One ray, voxels: it begins and ends outside of the grid's active voxels, but where the view's near plane cuts them.
struct PixelRay {
  int x = 0, y = 0;  ///< canvas
  openvdb::Vec3d from, direction;
  double steps = 0;  ///< voxels from begin to end
};

/// A view's rays, one for each sample of its tile.
class RayField {
 public:
  /// Both are referred to.
  RayField(const openvdb::FloatGrid& grid, const View& view);
  /// False where nothing of the grid lies behind the near plane.
  [[nodiscard]] bool any() const { return length_ > 0; }
  /// Of a ray, input units.
  [[nodiscard]] double length() const { return length_; }
  /// The depth at which rays begin (Projected::depth).
  [[nodiscard]] double start() const { return start_; }

  /// visit(worker, ray) for every sample; rows run side by side, each thread with a copy of the worker.
  template <class Worker, class Visit>
  void cast(const Worker& prototype, const Visit& visit) const {
    tbb::parallel_for(tbb::blocked_range<int>(0, view_.tile.height), [&](const tbb::blocked_range<int>& rows) {
      Worker worker = prototype;
      for (int row = rows.begin(); row < rows.end(); ++row)
        for (int column = 0; column < view_.tile.width; ++column) visit(worker, ray(row, column));
    });
  }

 private:
  [[nodiscard]] PixelRay ray(int row, int column) const;

  const openvdb::math::Transform& transform_;
  const View& view_;
  double start_ = 0, length_ = 0;
};

/// Looks colours up on one thread: it remembers the nodes it was in.
class GridColours {
 public:
  /// `grid`: `Cd`, 0 to 1; null where there is none.
  explicit GridColours(openvdb::Vec3SGrid::ConstPtr grid);
  /// Interpolated; nothing where there is no grid.
  [[nodiscard]] std::optional<Rgb> at(const openvdb::Vec3d& world) const;

 private:
  openvdb::Vec3SGrid::ConstPtr grid_;
  std::optional<openvdb::Vec3SGrid::ConstAccessor> values_;
};

}  // namespace lamina::render_detail

// Where the camera stands: directions, scale, and the part of the picture it fills.
#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "lamina/render.h"

namespace lamina::render_detail {

/// A rectangle of samples.
struct Tile {
  int x = 0, y = 0, width = 0, height = 0;
};

/// A projected point: samples right and down from the canvas's corner, and input units toward the viewer.
struct Projected {
  float x, y, depth;
};

struct View {
  Eigen::Vector3d right, up, toward;                    ///< orthonormal, input coordinates
  Tile tile;                                            ///< where it draws
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();     ///< what is in the tile's middle
  double scale = 1;                                     ///< samples per input unit
  float near = std::numeric_limits<float>::infinity();  ///< nothing of more depth is drawn

  [[nodiscard]] Projected project(const std::array<double, 3>& p) const {
    const Eigen::Vector3d d = Eigen::Vector3d(p[0], p[1], p[2]) - centre;
    return {static_cast<float>(tile.x + 0.5 * tile.width + scale * right.dot(d)),
            static_cast<float>(tile.y + 0.5 * tile.height - scale * up.dot(d)), static_cast<float>(toward.dot(d))};
  }
  /// A direction in the view's axes: right, up, toward the viewer.
  [[nodiscard]] Eigen::Vector3f direction(const std::array<float, 3>& n) const {
    const Eigen::Vector3d v(n[0], n[1], n[2]);
    return {static_cast<float>(right.dot(v)), static_cast<float>(up.dot(v)), static_cast<float>(toward.dot(v))};
  }
};

/// What a view must show: the extent along its axes of everything framed.
class Extent {
 public:
  void add(const View& view, const std::array<double, 3>& p);
  [[nodiscard]] bool empty() const { return low_[0] > high_[0]; }
  [[nodiscard]] double size(int axis) const { return empty() ? 0 : high_[axis] - low_[axis]; }
  [[nodiscard]] Eigen::Vector3d middle(const View& view) const;
  /// How far it reaches along an axis from where a place lies on it.
  [[nodiscard]] double reach(int axis, double place) const {
    return empty() ? 0 : std::max(std::abs(high_[axis] - place), std::abs(place - low_[axis]));
  }

 private:
  Eigen::Vector3d low_ = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector3d high_ = Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity());
};

/// The views of a picture with their directions and tiles; centre and scale are still to be fitted. `turned`: degrees
/// that the camera has gone around.
std::vector<View> make_views(const RenderSettings& settings, double turned = 0);

/// The views that must see everything: the picture's own, first; of a turn also enough of the others.
std::vector<View> framing_views(const RenderSettings& settings);

/// Fits the views to the extents of framing_views() at one common scale, or to the settings' zoom.
void fit_views(const RenderSettings& settings, const std::vector<View>& framing, const std::vector<Extent>& extents,
               std::vector<View>& views);

}  // namespace lamina::render_detail

// The picture while it is drawn: its views, its samples, and drawing into one view of these: meshes, edges and points
// rasterised (draw_primitives.cpp), level sets and fogs by rays (draw_level_set.cpp, draw_fog.cpp). canvas.cpp writes
// it, too, as PNG.
#pragma once
#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/mesh.h"
#include "lamina/render.h"
#include "lamina/volume.h"
#include "measure/edge_table.h"

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

// Samples of a picture: how they look, what is nearest at each, and averaging them into pixels. canvas.cpp writes
// these, too, as PNG.

using Rgb = std::array<float, 3>;  ///< linear light, 0 to 1

/// sRGB encoding, by table.
std::uint8_t encode(float linear);
float decode(std::uint8_t encoded);
/// The same of a number on the scale 0-255, rounded and clamped.
float decode(float byte);

/// Depth grows toward the viewer.
class Canvas {
 public:
  static constexpr float kOverEverything = std::numeric_limits<float>::infinity();

  Canvas(int width, int height)
      : width_(width),
        height_(height),
        depth_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), -kOverEverything),
        colour_(depth_.size(), {0, 0, 0, 0}) {}

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  /// True when something at `depth` would be seen; of equals the first one stays.
  [[nodiscard]] bool visible(int x, int y, float depth) const { return depth > depth_[index(x, y)]; }
  void set(int x, int y, float depth, const Rgb& colour) {
    depth_[index(x, y)] = depth;
    colour_[index(x, y)] = {encode(colour[0]), encode(colour[1]), encode(colour[2]), 1};
  }
  /// Light that something gives off, over what it lets through of what is there.
  void blend(int x, int y, float depth, const Rgb& light, float opacity);
  void clear() {
    std::fill(depth_.begin(), depth_.end(), -kOverEverything);
    std::fill(colour_.begin(), colour_.end(), std::array<std::uint8_t, 4>{});
  }
  /// Nothing was drawn yet.
  [[nodiscard]] bool blank() const;
  /// Averages squares of `supersample` samples over the background.
  [[nodiscard]] Image resolve(int supersample) const;

 private:
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
  }

  int width_, height_;
  std::vector<float> depth_;
  std::vector<std::array<std::uint8_t, 4>> colour_;  ///< the last byte: something was drawn
};

// Light and colour: how a surface point looks.

inline constexpr Rgb kClay{0.62F, 0.55F, 0.47F};
inline constexpr Rgb kBoundary{0.90F, 0.02F, 0.02F};

/// The colour of a surface lit from beside the camera; `normal` is a unit vector in the view's axes, facing the viewer.
Rgb lit(const Rgb& base, const Eigen::Vector3f& normal, bool back_face);

/// A normal's components (input coordinates) as a colour.
Rgb normal_colour(const std::array<float, 3>& normal);

/// Reads the colours among the attributes, whatever their type.
class ColourReader {
 public:
  /// Nothing when red, green and blue are not all there.
  static std::optional<ColourReader> find(const AttributeLayout& layout, const std::vector<std::vector<float>>& values);
  [[nodiscard]] Rgb operator()(std::size_t i) const;

 private:
  std::array<const std::vector<float>*, 3> channels_{};
  std::array<float, 3> to_byte_{};
};

// Drawing into one view of the canvas: meshes, edges and points rasterised (draw_primitives.cpp), level sets and fogs
// by rays (draw_level_set.cpp, draw_fog.cpp).

/// `normals` has one entry per vertex.
void draw_mesh(const TriangleMesh& mesh, const std::vector<std::array<float, 3>>& normals,
               const RenderSettings& settings, const View& view, Canvas& canvas);

/// Lines over everything drawn before or after.
void draw_edges(const TriangleMesh& mesh, const std::vector<measure::Edge>& edges, const RenderSettings& settings,
                const View& view, Canvas& canvas);

/// `radius` in input units serves points that have none of their own.
void draw_points(const SampleBatch& points, const AttributeLayout& layout, double radius,
                 const RenderSettings& settings, const View& view, Canvas& canvas);

/// World positions of voxels next to the surface.
void visit_surface(const LevelSet& level_set, const std::function<void(const std::array<double, 3>&)>& visit);

/// One ray per sample, by OpenVDB's level set ray intersector; shaded by the distances' gradient.
void draw_level_set(const LevelSet& level_set, const RenderSettings& settings, const View& view, Canvas& canvas);

/// World positions of the fog's voxels.
void visit_fog(const FogVolume& fog, const std::function<void(const std::array<double, 3>&)>& visit);

/// One ray per sample through the fog, by OpenVDB's volume ray intersector; what is behind shines through.
void draw_fog(const FogVolume& fog, const RenderSettings& settings, const View& view, Canvas& canvas);

}  // namespace lamina::render_detail

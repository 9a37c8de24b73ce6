// Samples of a picture: how they look, what is nearest at each, and averaging them into pixels. canvas.cpp writes
// these, too, as PNG.
#pragma once
#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/render.h"

namespace lamina::render_detail {

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

}  // namespace lamina::render_detail

// Light and colour: how a surface point looks.
#pragma once
#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "lamina/attributes.h"
#include "render/canvas.h"

namespace lamina::render_detail {

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

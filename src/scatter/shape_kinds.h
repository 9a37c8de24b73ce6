// Makers of the procedural shapes.
#pragma once
#include <array>
#include <memory>

#include "lamina/scatter.h"

namespace lamina::scatter_detail {

std::unique_ptr<Surface> sphere_surface(bool colours);
std::unique_ptr<Surface> torus_surface(double tube_centre, double tube, bool colours);
/// Corners at +-half; half[2] = 0 is the upper side of a rectangle.
std::unique_ptr<Surface> box_surface(const std::array<double, 3>& half, bool colours);

/// A radius as a function of the direction, with the gradient of its extension to space.
class RadialFunction {
 public:
  struct Value {
    double radius;
    std::array<double, 3> gradient;  ///< only its part across the direction counts
  };
  virtual ~RadialFunction() = default;
  RadialFunction(const RadialFunction&) = delete;
  RadialFunction& operator=(const RadialFunction&) = delete;
  [[nodiscard]] virtual Value at(const std::array<double, 3>& direction) const = 0;

 protected:
  RadialFunction() = default;
};
/// The surface scale * radius(d) * d over all directions d.
std::unique_ptr<Surface> radial_surface(std::unique_ptr<RadialFunction> radius, const std::array<double, 3>& scale,
                                        bool colours);
std::unique_ptr<RadialFunction> bumps();
std::unique_ptr<RadialFunction> draped_figure();

}  // namespace lamina::scatter_detail

// What procedural shapes are made of. Their periodic functions are built from exact arithmetic alone, so that a shape
// has the same bits on every machine (the C library's sine may differ in the last bit between processors).
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "lamina/mesh.h"
#include "lamina/scatter.h"
#include "meshes/formats.h"
#include "meshes/vec3.h"

namespace lamina::scatter_detail {

struct SinCos {
  double sine, cosine;
};

/// sin and cos of 2 pi t, within 1e-15 for |t| < 2^40.
inline SinCos sincos_turns(double t) {
  // To the nearest eighth of a turn, then Taylor polynomials on [-pi/4, pi/4].
  const double quarters = std::floor(4 * t + 0.5);
  const double y = 6.283185307179586476925 * (t - 0.25 * quarters);
  const double z = y * y;
  const double s =
      y * (1 + z * (-1.0 / 6 +
                    z * (1.0 / 120 +
                         z * (-1.0 / 5040 + z * (1.0 / 362880 + z * (-1.0 / 39916800 + z * (1.0 / 6227020800.0 -
                                                                                            z / 1307674368000.0)))))));
  const double c =
      1 + z * (-0.5 + z * (1.0 / 24 +
                           z * (-1.0 / 720 +
                                z * (1.0 / 40320 + z * (-1.0 / 3628800 + z * (1.0 / 479001600 - z / 87178291200.0))))));
  switch (static_cast<long long>(quarters) & 3) {
    case 0:
      return {s, c};
    case 1:
      return {c, -s};
    case 2:
      return {-s, -c};
    default:
      return {-c, s};
  }
}

struct Wave {
  double value, slope;
};

/// A wave of period 1 made of two parabolas: between -1 and 1, its slope continuous, its curvature jumping at the
/// zeros.
inline Wave parabolic_wave(double t) {
  const double u = t - std::floor(t + 0.5);
  const double a = std::fabs(u);
  return {8 * u * (1 - 2 * a), 8 - 32 * a};
}

/// Independent draws for a sample's further tries.
inline std::uint64_t attempt_seed(std::uint64_t seed, std::uint32_t attempt) {
  return seed + attempt * 0xD1B54A32D192ED03ull;
}

/// A smooth pattern of the position, 27.5 to 227.5 in each channel; |gradient| at most 1100 per unit of length.
inline std::array<float, 3> shape_colour(const std::array<double, 3>& p) {
  const auto channel = [](double t) { return static_cast<float>(127.5 + 100 * parabolic_wave(t).value); };
  return {channel(0.9 * p[0] + 0.4 * p[1]), channel(0.8 * p[1] - 0.5 * p[2] + 0.25),
          channel(0.7 * p[2] + 0.6 * p[0] + 0.6)};
}

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

// Normals and colours anywhere on a mesh.

class MeshAttributes {
 public:
  /// The mesh must outlive it. Normals the file lacks are made: area-weighted means of the faces around a vertex.
  explicit MeshAttributes(const TriangleMesh& mesh);
  /// Unit; the triangle's own where the vertices' normals cancel.
  [[nodiscard]] std::array<double, 3> normal(const meshes::SurfacePoint& at) const;
  /// 0-255 whatever type the file has; zero without colours.
  [[nodiscard]] std::array<float, 3> colour(const meshes::SurfacePoint& at) const;
  [[nodiscard]] bool has_colour() const { return colours_.has_value(); }

 private:
  const TriangleMesh& mesh_;
  std::vector<std::array<float, 3>> made_normals_;
  const std::vector<std::array<float, 3>>& normals_;
  std::optional<meshes::ColourColumns> colours_;
};

}  // namespace lamina::scatter_detail

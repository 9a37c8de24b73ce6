// Random oriented samples with radii, in fixed-point steps.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

#include "store/slab_store.h"

namespace lamina::test {

enum class Shape { plane, sphere, torus, scatter };  ///< scatter: anywhere in a box, normals at random

struct CloudSettings {
  Shape shape = Shape::sphere;
  std::size_t samples = 300;
  std::array<int, 3> centre{0, 0, 0};
  double size = 600;        ///< radius of the shape; half the side of plane and box
  double radius_low = 150;  ///< influence radii change along x between these
  double radius_high = 150;
  double radius_spread = 1.2;  ///< and by up to this factor at random
  double noise = 0;            ///< displacement and tilt of normals, in radii
  int attributes = 0;
  bool quality = false;
};

inline LocalSamples random_cloud(const CloudSettings& s, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  std::normal_distribution<double> normal;
  const auto direction = [&] {
    std::array<double, 3> d{normal(random), normal(random), normal(random)};
    const double length = std::hypot(d[0], d[1], d[2]);
    for (double& c : d) c /= length;
    return d;
  };
  const std::array<double, 3> up = direction();
  LocalSamples out;
  out.attributes.resize(static_cast<std::size_t>(s.attributes));
  for (std::size_t i = 0; i < s.samples; ++i) {
    std::array<double, 3> p{};
    std::array<double, 3> n = direction();
    if (s.shape == Shape::sphere) {
      for (int k = 0; k < 3; ++k) p[k] = s.size * n[k];
    } else if (s.shape == Shape::torus) {
      const double u = 2 * std::numbers::pi * unit(random);
      const double v = 2 * std::numbers::pi * unit(random);
      n = {std::cos(u) * std::cos(v), std::sin(u) * std::cos(v), std::sin(v)};
      const double ring = s.size * (0.7 + 0.3 * std::cos(v));
      p = {ring * std::cos(u), ring * std::sin(u), 0.3 * s.size * std::sin(v)};
    } else {
      for (double& c : p) c = s.size * (2 * unit(random) - 1);
      if (s.shape == Shape::plane) {
        n = up;
        const double along = p[0] * n[0] + p[1] * n[1] + p[2] * n[2];
        for (int k = 0; k < 3; ++k) p[k] -= along * n[k];
      }
    }
    const double mix = std::clamp(0.5 + 0.6 * p[0] / s.size, 0.0, 1.0);
    const double r =
        s.radius_low * std::pow(s.radius_high / s.radius_low, mix) * std::pow(s.radius_spread, 2 * unit(random) - 1);
    for (int k = 0; k < 3; ++k) {
      p[k] += s.noise * r * normal(random);
      n[k] += s.noise * normal(random);
    }
    const double length = std::hypot(n[0], n[1], n[2]);
    out.x.push_back(s.centre[0] + static_cast<std::int32_t>(std::lround(p[0])));
    out.y.push_back(s.centre[1] + static_cast<std::int32_t>(std::lround(p[1])));
    out.z.push_back(s.centre[2] + static_cast<std::int32_t>(std::lround(p[2])));
    out.nx.push_back(static_cast<float>(n[0] / length));
    out.ny.push_back(static_cast<float>(n[1] / length));
    out.nz.push_back(static_cast<float>(n[2] / length));
    out.radius.push_back(static_cast<float>(r));
    if (s.quality) out.quality.push_back(static_cast<float>(0.25 + unit(random)));
    for (auto& a : out.attributes) a.push_back(static_cast<float>(255 * unit(random)));
  }
  return out;
}

}  // namespace lamina::test

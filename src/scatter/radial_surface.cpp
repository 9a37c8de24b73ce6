// Star-shaped surfaces, stretched along the axes: a sphere with bumps and a draped figure.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>

#include "base/hashing.h"
#include "meshes/vec3.h"
#include "scatter/shapes.h"

namespace lamina::scatter_detail {

using namespace meshes;

namespace {

constexpr std::uint64_t kProbes = 1u << 17;
constexpr std::uint64_t kProbeSeed = 0x70726F6265ull;

Vec3 random_direction(CounterRng& rng) {
  const double z = rng.symmetric();
  const auto [s, c] = sincos_turns(rng.uniform());
  const double across = std::sqrt(1 - z * z);
  return {across * c, across * s, z};
}

class RadialSurface final : public Surface {
 public:
  RadialSurface(std::unique_ptr<RadialFunction> radius, const Vec3& scale, bool colours)
      : radius_(std::move(radius)), scale_(scale), colours_(colours) {
    double sum = 0;
    for (std::uint64_t i = 0; i < kProbes; ++i) {
      CounterRng rng(kProbeSeed, i);
      const Place p = place(random_direction(rng));
      sum += p.area_per_angle;
      bound_ = std::max(bound_, p.area_per_angle);
      for (std::size_t k = 0; k < 3; ++k) {
        box_.low[k] = std::min(box_.low[k], p.position[k]);
        box_.high[k] = std::max(box_.high[k], p.position[k]);
      }
    }
    area_ = 4 * std::numbers::pi * sum / static_cast<double>(kProbes);
    bound_ *= 1.05;  // the steepest places are rare enough to be missed by every probe
  }

  [[nodiscard]] Point point(std::uint64_t seed, std::uint64_t sample, std::uint32_t attempt) const override {
    CounterRng rng(attempt_seed(seed, attempt), sample);
    for (;;) {
      const Place p = place(random_direction(rng));
      if (rng.uniform() * bound_ >= p.area_per_angle) continue;
      return {p.position, unit(p.normal), colours_ ? shape_colour(p.position) : std::array<float, 3>{}};
    }
  }
  [[nodiscard]] double area() const override { return area_; }
  [[nodiscard]] Box box() const override { return box_; }
  [[nodiscard]] bool has_colour() const override { return colours_; }

 private:
  struct Place {
    Vec3 position, normal;  ///< normal of any length
    double area_per_angle;
  };
  /// For the unstretched surface r(d) d the vector r^2 (d - g / r), g the gradient's part across d, is the normal with
  /// the area per solid angle as its length; a linear map takes it along by its cofactors.
  [[nodiscard]] Place place(const Vec3& d) const {
    const auto [r, gradient] = radius_->at(d);
    const Vec3 across = gradient - dot(gradient, d) * d;
    const Vec3 n = r * (r * d - across);
    const Vec3 stretched{scale_[1] * scale_[2] * n[0], scale_[2] * scale_[0] * n[1], scale_[0] * scale_[1] * n[2]};
    return {{scale_[0] * r * d[0], scale_[1] * r * d[1], scale_[2] * r * d[2]}, stretched, norm(stretched)};
  }

  std::unique_ptr<RadialFunction> radius_;
  Vec3 scale_;
  bool colours_;
  double bound_ = 0, area_ = 0;
  Box box_;
};

/// Smooth bumps on a lattice: the product of three waves.
class Bumps final : public RadialFunction {
 public:
  [[nodiscard]] Value at(const Vec3& d) const override {
    constexpr double kWaves = 1.5, kHeight = 0.12, kSlope = 2 * std::numbers::pi * kWaves;
    const SinCos x = sincos_turns(kWaves * d[0]), y = sincos_turns(kWaves * d[1] + 0.2),
                 z = sincos_turns(kWaves * d[2] + 0.1);
    return {
        1 + kHeight * x.sine * y.sine * z.sine,
        kHeight * kSlope * Vec3{x.cosine * y.sine * z.sine, x.sine * y.cosine * z.sine, x.sine * y.sine * z.cosine}};
  }
};

/// A column with head, shoulders and hem, folds running down it, and chisel marks in ever finer octaves.
class DrapedFigure final : public RadialFunction {
 public:
  DrapedFigure() {
    constexpr std::uint64_t kChiselSeed = 0x63686973656Cull;
    double waves = 3, height = 0.012;
    for (std::uint64_t octave = 0; octave < kOctaves; ++octave, waves *= 2, height *= 0.5)
      for (std::uint64_t k = 0; k < kDirections; ++k) {
        CounterRng rng(kChiselSeed, octave * kDirections + k);
        const Vec3 d = random_direction(rng);
        marks_[octave * kDirections + k] = {waves * d, rng.uniform(), height};
      }
  }
  [[nodiscard]] Value at(const Vec3& d) const override {
    Value v{1, {}};
    const SinCos silhouette = sincos_turns(1.05 * d[2] + 0.1), hem = sincos_turns(2.3 * d[2] - 0.2);
    v.radius += 0.16 * silhouette.cosine + 0.05 * hem.sine;
    v.gradient[2] += 2 * std::numbers::pi * (-0.16 * 1.05 * silhouette.sine + 0.05 * 2.3 * hem.cosine);
    const auto add = [&](const Mark& m) {
      const Wave w = parabolic_wave(dot(m.waves, d) + m.phase);
      v.radius += m.height * w.value;
      v.gradient = v.gradient + (m.height * w.slope) * m.waves;
    };
    for (const Mark& fold : kFolds) add(fold);
    for (const Mark& mark : marks_) add(mark);
    return v;
  }

 private:
  struct Mark {
    Vec3 waves;  ///< wave vector, cycles per unit
    double phase, height;
  };
  static constexpr std::size_t kOctaves = 9, kDirections = 3;
  static constexpr std::array<Mark, 2> kFolds{{{{2.6, 1.1, 0.3}, 0.1, 0.035}, {{-1.3, 2.9, 0.4}, 0.6, 0.03}}};
  std::array<Mark, kOctaves * kDirections> marks_;
};

}  // namespace

std::unique_ptr<Surface> radial_surface(std::unique_ptr<RadialFunction> radius, const Vec3& scale, bool colours) {
  return std::make_unique<RadialSurface>(std::move(radius), scale, colours);
}
std::unique_ptr<RadialFunction> bumps() {
  return std::make_unique<Bumps>();
}
std::unique_ptr<RadialFunction> draped_figure() {
  return std::make_unique<DrapedFigure>();
}

}  // namespace lamina::scatter_detail

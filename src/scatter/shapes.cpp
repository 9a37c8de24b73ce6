#include "scatter/shapes.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "base/hashing.h"
#include "lamina/error.h"
#include "lamina/scatter.h"
#include "meshes/vec3.h"

namespace lamina {
namespace {

using namespace meshes;
using namespace scatter_detail;
using std::numbers::pi;

/// Sphere, torus and boxes are sampled exactly by area.
class BasicShape : public Surface {
 public:
  explicit BasicShape(bool colours) : colours_(colours) {}
  [[nodiscard]] Point point(std::uint64_t seed, std::uint64_t sample, std::uint32_t attempt) const final {
    CounterRng rng(attempt_seed(seed, attempt), sample);
    Point p = place(rng);
    if (colours_) p.colour = shape_colour(p.position);
    return p;
  }
  [[nodiscard]] bool has_colour() const final { return colours_; }

 protected:
  [[nodiscard]] virtual Point place(CounterRng& rng) const = 0;

 private:
  bool colours_;
};

class Sphere final : public BasicShape {
 public:
  using BasicShape::BasicShape;
  [[nodiscard]] double area() const override { return 4 * pi; }
  [[nodiscard]] Box box() const override { return {{-1, -1, -1}, {1, 1, 1}}; }

 private:
  [[nodiscard]] Point place(CounterRng& rng) const override {
    const double z = rng.symmetric();
    const auto [s, c] = sincos_turns(rng.uniform());
    const double across = std::sqrt(1 - z * z);
    const Vec3 d{across * c, across * s, z};
    return {d, d, {}};
  }
};

class Torus final : public BasicShape {
 public:
  Torus(double tube_centre, double tube, bool colours) : BasicShape(colours), centre_(tube_centre), tube_(tube) {}
  [[nodiscard]] double area() const override { return 4 * pi * pi * centre_ * tube_; }
  [[nodiscard]] Box box() const override {
    const double out = centre_ + tube_;
    return {{-out, -out, -tube_}, {out, out, tube_}};
  }

 private:
  [[nodiscard]] Point place(CounterRng& rng) const override {
    const SinCos around = sincos_turns(rng.uniform());
    for (;;) {  // the tube is longer outside than inside: reject by its circumference
      const SinCos tube = sincos_turns(rng.uniform());
      const double out = centre_ + tube_ * tube.cosine;
      if (rng.uniform() * (centre_ + tube_) >= out) continue;
      return {{out * around.cosine, out * around.sine, tube_ * tube.sine},
              {tube.cosine * around.cosine, tube.cosine * around.sine, tube.sine},
              {}};
    }
  }
  double centre_, tube_;
};

class BoxShape final : public BasicShape {
 public:
  BoxShape(const Vec3& half, bool colours)
      : BasicShape(colours), half_(half), pairs_{8 * half[1] * half[2], 8 * half[2] * half[0], 8 * half[0] * half[1]} {}
  [[nodiscard]] double area() const override {
    return half_[2] > 0 ? pairs_[0] + pairs_[1] + pairs_[2] : pairs_[2] / 2;
  }
  [[nodiscard]] Box box() const override { return {-1.0 * half_, half_}; }

 private:
  [[nodiscard]] Point place(CounterRng& rng) const override {
    std::size_t axis = 2;
    double side = 1;
    if (half_[2] > 0) {
      const double pick = rng.uniform() * area();
      axis = pick < pairs_[0] ? 0 : pick < pairs_[0] + pairs_[1] ? 1 : 2;
      side = (rng.bits() >> 63) != 0 ? 1 : -1;
    }
    Point p;
    for (std::size_t k = 0; k < 3; ++k) p.position[k] = k == axis ? side * half_[k] : half_[k] * rng.symmetric();
    p.normal[axis] = side;
    return p;
  }
  Vec3 half_;
  Vec3 pairs_;  ///< area of the two sides across each axis
};

/// Corners at +-x, +-y, +-z; z = 0 is the upper side of a rectangle.
std::unique_ptr<Surface> box(double x, double y, double z, bool colours) {
  return std::make_unique<BoxShape>(Vec3{x, y, z}, colours);
}

using Maker = std::unique_ptr<Surface> (*)(bool colours);

constexpr std::array<std::pair<const char*, Maker>, 7> kShapes{{
    {"sphere", [](bool c) -> std::unique_ptr<Surface> { return std::make_unique<Sphere>(c); }},
    {"torus", [](bool c) -> std::unique_ptr<Surface> { return std::make_unique<Torus>(1, 0.4, c); }},
    {"plane", [](bool c) { return box(1, 1, 0, c); }},
    {"cube", [](bool c) { return box(1, 1, 1, c); }},
    {"thin-sheet", [](bool c) { return box(1, 1, 0.01, c); }},
    {"bumpy-sphere",
     [](bool c) {
       return radial_surface(bumps(), {1, 1, 1}, c);
     }},
    {"statue",
     [](bool c) {
       return radial_surface(draped_figure(), {0.55, 0.45, 1.4}, c);
     }},
}};

}  // namespace

std::vector<std::string> shape_names() {
  std::vector<std::string> names;
  names.reserve(kShapes.size());
  for (const auto& [name, maker] : kShapes) names.emplace_back(name);
  return names;
}

std::unique_ptr<Surface> shape_surface(const std::string& name, bool colours) {
  for (const auto& [known, maker] : kShapes)
    if (name == known) return maker(colours);
  throw Error(ExitCode::usage, fmt::format("unknown shape \"{}\"; known are {}", name, fmt::join(shape_names(), ", ")));
}

}  // namespace lamina

// Procedural shapes by name: round and flat ones, and star-shaped surfaces, stretched along the axes: a sphere with
// bumps and a draped figure.
#include "scatter/shapes.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
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
#include "measure/triangle_bvh.h"
#include "meshes/vec3.h"

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

namespace lamina::scatter_detail {

using namespace meshes;

MeshAttributes::MeshAttributes(const TriangleMesh& mesh)
    : mesh_(mesh),
      made_normals_(mesh.normals.empty() ? vertex_normals(mesh) : std::vector<std::array<float, 3>>{}),
      normals_(mesh.normals.empty() ? made_normals_ : mesh.normals),
      colours_(find_colours(mesh)) {}

Vec3 MeshAttributes::normal(const SurfacePoint& at) const {
  const auto& c = mesh_.triangles[at.triangle];
  const Vec3 n = at.weights[0] * unit(to_double(normals_[c[0]])) + at.weights[1] * unit(to_double(normals_[c[1]])) +
                 at.weights[2] * unit(to_double(normals_[c[2]]));
  const double length = norm(n);
  if (length > 1e-6) return (1 / length) * n;
  return unit(area_normal(mesh_, at.triangle));
}

std::array<float, 3> MeshAttributes::colour(const SurfacePoint& at) const {
  std::array<float, 3> out{};
  if (!colours_) return out;
  const auto& c = mesh_.triangles[at.triangle];
  for (std::size_t corner = 0; corner < 3; ++corner) {
    const auto value = colours_->at(mesh_, c[corner]);
    for (std::size_t k = 0; k < 3; ++k) out[k] += static_cast<float>(at.weights[corner]) * value[k];
  }
  return out;
}

}  // namespace lamina::scatter_detail

namespace lamina {
namespace {

using namespace meshes;

class MeshSurface final : public Surface {
 public:
  explicit MeshSurface(const TriangleMesh& mesh) : mesh_(mesh), areas_(mesh), attributes_(mesh) {
    if (mesh.triangles.empty()) throw Error(ExitCode::unreadable, "scatter: the mesh has no triangles");
    if (!(areas_.total_area() > 0)) throw Error(ExitCode::unreadable, "scatter: the mesh's triangles have no area");
    const measure::Bounds bounds = measure::triangle_bounds(mesh);
    box_ = {bounds.low, bounds.high};
  }
  [[nodiscard]] Point point(std::uint64_t seed, std::uint64_t sample, std::uint32_t attempt) const override {
    CounterRng rng(scatter_detail::attempt_seed(seed, attempt), sample);
    const double u = rng.uniform(), v = rng.uniform(), w = rng.uniform();
    const SurfacePoint at = areas_.at(u, v, w);
    return {position_at(mesh_, at), attributes_.normal(at), attributes_.colour(at)};
  }
  [[nodiscard]] double area() const override { return areas_.total_area(); }
  [[nodiscard]] Box box() const override { return box_; }
  [[nodiscard]] bool has_colour() const override { return attributes_.has_colour(); }

 private:
  const TriangleMesh& mesh_;
  AreaSampler areas_;
  scatter_detail::MeshAttributes attributes_;
  Box box_;
};

}  // namespace

std::unique_ptr<Surface> mesh_surface(const TriangleMesh& mesh) {
  return std::make_unique<MeshSurface>(mesh);
}

}  // namespace lamina

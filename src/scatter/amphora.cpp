#include <algorithm>
#include <array>
#include <cmath>

#include "lamina/scatter.h"
#include "meshes/vec3.h"
#include "scatter/shapes.h"

namespace lamina {
namespace {

using namespace meshes;
using scatter_detail::sincos_turns;

using Colour = std::array<float, 3>;
constexpr Colour kClay{196, 104, 58}, kGlaze{38, 30, 34}, kCream{236, 216, 172}, kBlue{44, 92, 140};

/// Radius and height along the outline, from the middle of the foot to the rim.
constexpr std::array<std::array<double, 2>, 14> kOutline{{{0.00, 0.00},
                                                          {0.16, 0.00},
                                                          {0.27, 0.01},
                                                          {0.28, 0.05},
                                                          {0.14, 0.12},
                                                          {0.24, 0.27},
                                                          {0.42, 0.45},
                                                          {0.51, 0.66},
                                                          {0.46, 0.88},
                                                          {0.27, 1.06},
                                                          {0.18, 1.18},
                                                          {0.18, 1.34},
                                                          {0.22, 1.45},
                                                          {0.31, 1.52}}};

/// Smooth step from 0 at a to 1 at b.
double ramp(double x, double a, double b) {
  const double t = std::clamp((x - a) / (b - a), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}
/// 1 between a and b, falling to 0 over `soft` on either side.
double band(double x, double a, double b, double soft) {
  return ramp(x, a - soft, a) * (1 - ramp(x, b, b + soft));
}

Colour mixed(const Colour& a, const Colour& b, double t) {
  Colour c{};
  for (std::size_t k = 0; k < 3; ++k) c[k] = static_cast<float>((1 - t) * a[k] + t * b[k]);
  return c;
}

/// Catmull-Rom curve through the outline, t from 0 to 1.
std::array<double, 2> outline(double t) {
  constexpr std::size_t kLast = kOutline.size() - 1;
  const double s = t * static_cast<double>(kLast);
  const std::size_t i = std::min(static_cast<std::size_t>(s), kLast - 1);
  const double u = s - static_cast<double>(i);
  const auto& p1 = kOutline[i];
  const auto& p2 = kOutline[i + 1];
  const auto& p0 = kOutline[i == 0 ? 0 : i - 1];
  const auto& p3 = kOutline[std::min(i + 2, kLast)];
  std::array<double, 2> p{};
  for (std::size_t k = 0; k < 2; ++k)
    p[k] = p1[k] + 0.5 * u *
                       (p2[k] - p0[k] +
                        u * (2 * p0[k] - 5 * p1[k] + 4 * p2[k] - p3[k] + u * (3 * (p1[k] - p2[k]) + p3[k] - p0[k])));
  return p;
}

/// What stands proud of the wall: flutes on the lower belly, rope and lozenges on the band. `turn` in [0, 1).
double relief(double turn, double z) {
  const double flutes = 0.006 * band(z, 0.30, 0.48, 0.06) * sincos_turns(28 * turn).sine;
  const double lozenges = sincos_turns(16 * turn + 4 * z).sine * sincos_turns(16 * turn - 4 * z).sine;
  const double frieze = 0.011 * band(z, 0.62, 0.76, 0.015) * lozenges;
  const double ropes =
      0.008 * (band(z, 0.585, 0.595, 0.012) + band(z, 0.785, 0.795, 0.012)) * (1 + 0.35 * sincos_turns(64 * turn).sine);
  return flutes + frieze + ropes;
}

Colour glaze(double turn, double z) {
  Colour c = mixed(kClay, kGlaze, band(z, -0.1, 0.24, 0.01));
  c = mixed(c, kGlaze, band(z, 1.20, 1.47, 0.008));
  // Tongues hang from the shoulder, a wave runs along it.
  const double tongue = 0.99 - 0.07 * (1 + sincos_turns(24 * turn).cosine);
  c = mixed(c, kGlaze, band(z, tongue, 1.03, 0.006));
  const double crest = 1.11 + 0.025 * sincos_turns(9 * turn).sine;
  c = mixed(c, kBlue, band(z, crest - 0.012, crest + 0.012, 0.005));
  const double lozenges = sincos_turns(16 * turn + 4 * z).sine * sincos_turns(16 * turn - 4 * z).sine;
  c = mixed(c, mixed(kBlue, kCream, ramp(lozenges, -0.15, 0.15)), band(z, 0.61, 0.77, 0.006));
  return mixed(c, kCream, band(z, 1.495, 1.6, 0.005));
}

class Potter {
 public:
  Potter() {
    for (const char* name : {"red", "green", "blue"}) mesh_.layout.push_back({name, ScalarType::uint8});
    mesh_.attributes.resize(3);
  }
  void throw_body() {
    constexpr std::uint32_t kRings = 360, kAround = 720;
    const std::uint32_t centre = add({0, 0, 0}, kGlaze);
    for (std::uint32_t ring = 1; ring <= kRings; ++ring) {
      const auto [r, z] = outline(static_cast<double>(ring) / kRings);
      for (std::uint32_t k = 0; k < kAround; ++k) {
        const double turn = static_cast<double>(k) / kAround;
        const auto [s, c] = sincos_turns(turn);
        const double out = r + relief(turn, z);
        add({out * c, out * s, z}, glaze(turn, z));
      }
    }
    for (std::uint32_t k = 0; k < kAround; ++k)
      mesh_.triangles.push_back({centre, centre + 1 + (k + 1) % kAround, centre + 1 + k});
    stitch(centre + 1, kRings, kAround);
  }
  /// A tube along a Bezier curve in the plane of the axis, on the side `side` = 1 or -1.
  void pull_handle(double side) {
    constexpr std::uint32_t kRings = 160, kAround = 48;
    constexpr double kRadius = 0.035;
    constexpr std::array<std::array<double, 2>, 4> kControl{{{0.385, 0.90}, {0.82, 1.02}, {0.62, 1.29}, {0.175, 1.27}}};
    const auto first = static_cast<std::uint32_t>(mesh_.positions.size());
    for (std::uint32_t ring = 0; ring < kRings; ++ring) {
      const double t = static_cast<double>(ring) / (kRings - 1), q = 1 - t;
      std::array<double, 2> p{}, along{};
      for (std::size_t k = 0; k < 2; ++k) {
        p[k] = q * q * q * kControl[0][k] + 3 * q * q * t * kControl[1][k] + 3 * q * t * t * kControl[2][k] +
               t * t * t * kControl[3][k];
        along[k] = q * q * (kControl[1][k] - kControl[0][k]) + 2 * q * t * (kControl[2][k] - kControl[1][k]) +
                   t * t * (kControl[3][k] - kControl[2][k]);
      }
      const double length = std::sqrt(along[0] * along[0] + along[1] * along[1]);
      const std::array<double, 2> across{along[1] / length, -along[0] / length};
      const double stripe = sincos_turns(9 * t).sine;
      for (std::uint32_t k = 0; k < kAround; ++k) {
        const auto [s, c] = sincos_turns(side * static_cast<double>(k) / kAround);
        add({side * (p[0] + kRadius * c * across[0]), kRadius * s, p[1] + kRadius * c * across[1]},
            mixed(kGlaze, kClay, ramp(stripe, -0.1, 0.1)));
      }
    }
    stitch(first, kRings, kAround);
  }
  TriangleMesh finish() { return std::move(mesh_); }

 private:
  std::uint32_t add(const Vec3& p, const Colour& c) {
    mesh_.positions.push_back(p);
    for (std::size_t k = 0; k < 3; ++k) mesh_.attributes[k].push_back(c[k]);
    return static_cast<std::uint32_t>(mesh_.positions.size() - 1);
  }
  void stitch(std::uint32_t first, std::uint32_t rings, std::uint32_t around) {
    for (std::uint32_t ring = 0; ring + 1 < rings; ++ring)
      for (std::uint32_t k = 0; k < around; ++k) {
        const std::uint32_t a = first + ring * around + k, b = first + ring * around + (k + 1) % around;
        mesh_.triangles.push_back({a, b, b + around});
        mesh_.triangles.push_back({a, b + around, a + around});
      }
  }
  TriangleMesh mesh_;
};

}  // namespace

TriangleMesh amphora_mesh() {
  Potter potter;
  potter.throw_body();
  potter.pull_handle(1);
  potter.pull_handle(-1);
  return potter.finish();
}

}  // namespace lamina

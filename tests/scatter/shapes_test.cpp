#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "lamina/scatter.h"
#include "meshes/vec3.h"
#include "scatter/shapes.h"

namespace lamina {
namespace {

using namespace meshes;

Surface::Point at(const Surface& s, std::uint64_t i) {
  return s.point(1, i, 0);
}

TEST(Waves, SineAndCosineOfTurns) {
  for (int i = -4000; i <= 4000; ++i) {
    const double t = i * 0.00137;
    const auto [s, c] = scatter_detail::sincos_turns(t);
    EXPECT_NEAR(s, std::sin(2 * std::acos(-1.0) * t), 1e-14);
    EXPECT_NEAR(c, std::cos(2 * std::acos(-1.0) * t), 1e-14);
  }
  // The polynomials are worst at the ends of their range, odd eighths of a turn.
  for (int i = -400; i <= 400; ++i) {
    const auto [s, c] = scatter_detail::sincos_turns(0.125 + i * 1e-5);
    EXPECT_NEAR(s, std::sin(2 * std::acos(-1.0) * (0.125 + i * 1e-5)), 2e-15);
    EXPECT_NEAR(c, std::cos(2 * std::acos(-1.0) * (0.125 + i * 1e-5)), 2e-15);
  }
}

TEST(Waves, ParabolicSlopeIsTheDerivative) {
  for (double t = -2; t < 2; t += 0.0131) {
    const double h = 1e-7;
    const double difference =
        (scatter_detail::parabolic_wave(t + h).value - scatter_detail::parabolic_wave(t - h).value) / (2 * h);
    EXPECT_NEAR(scatter_detail::parabolic_wave(t).slope, difference, 1e-5);
    EXPECT_LE(std::fabs(scatter_detail::parabolic_wave(t).value), 1.0);
  }
}

TEST(ShapeSurface, SphereIsUniformAndExact) {
  const auto s = shape_surface("sphere", false);
  std::vector<double> bins(20 * 8);
  constexpr int kCount = 160000;
  for (std::uint64_t i = 0; i < kCount; ++i) {
    const auto p = at(*s, i);
    EXPECT_NEAR(norm(p.position), 1, 1e-14);
    EXPECT_EQ(p.normal, p.position);
    const double turn = std::atan2(p.position[1], p.position[0]) / (2 * std::acos(-1.0)) + 0.5;
    ++bins[std::min<std::size_t>(19, static_cast<std::size_t>((p.position[2] + 1) * 10)) * 8 +
           std::min<std::size_t>(7, static_cast<std::size_t>(turn * 8))];
  }
  double chi = 0;
  for (const double b : bins) chi += (b - 1000) * (b - 1000) / 1000;
  EXPECT_LT(chi, 159 + 4 * std::sqrt(318));
}

TEST(ShapeSurface, TorusIsUniformAndExact) {
  const auto s = shape_surface("torus", false);
  // By Guldin: the outer half of the tube has the area pi (pi + 2 r / R) of its 2 pi^2, in units of r R.
  constexpr int kCount = 100000;
  int outer = 0;
  for (std::uint64_t i = 0; i < kCount; ++i) {
    const auto p = at(*s, i);
    const double rho = std::hypot(p.position[0], p.position[1]);
    EXPECT_NEAR(std::hypot(rho - 1, p.position[2]), 0.4, 1e-14);
    EXPECT_NEAR(norm(p.normal), 1, 1e-14);
    outer += rho > 1;
  }
  const double pi = std::acos(-1.0), share = (pi + 0.8) / (2 * pi);
  EXPECT_NEAR(outer, share * kCount, 4 * std::sqrt(share * (1 - share) * kCount));
  EXPECT_NEAR(s->area(), 4 * pi * pi * 0.4, 1e-12);
}

TEST(ShapeSurface, BoxesLieOnTheirSides) {
  for (const auto& [name, z] : {std::pair{"cube", 1.0}, std::pair{"thin-sheet", 0.01}, std::pair{"plane", 0.0}}) {
    const auto s = shape_surface(name, false);
    int top = 0;
    constexpr int kCount = 40000;
    for (std::uint64_t i = 0; i < kCount; ++i) {
      const auto p = at(*s, i);
      EXPECT_EQ(norm(p.normal), 1);
      EXPECT_DOUBLE_EQ(dot(p.normal, p.position), p.normal[2] != 0 ? z : 1.0) << name;
      top += p.normal[2] > 0;
    }
    const double share = z == 0 ? 1 : 4 / s->area();
    EXPECT_NEAR(top, share * kCount, 4 * std::sqrt(share * kCount)) << name;
  }
}

/// The normal must be across every small step along the surface.
void expect_normals_match(const scatter_detail::RadialFunction& f, double step, double tolerance) {
  for (int i = 0; i < 2000; ++i) {
    const double z = 1 - (2 * i + 1) / 2000.0, turn = i * 2.399963;
    const Vec3 d{std::sqrt(1 - z * z) * std::cos(turn), std::sqrt(1 - z * z) * std::sin(turn), z};
    const auto [r, g] = f.at(d);
    for (const Vec3& axis : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}) {
      const Vec3 ahead = unit(d + step * axis), behind = unit(d - step * axis);
      const double measured = f.at(ahead).radius - f.at(behind).radius;
      EXPECT_NEAR(measured / (2 * step), dot(g, ahead - behind) / (2 * step), tolerance);
    }
  }
}

TEST(ShapeSurface, GradientsAreDerivatives) {
  expect_normals_match(*scatter_detail::bumps(), 1e-5, 1e-6);
  expect_normals_match(*scatter_detail::draped_figure(), 1e-7, 0.01);
}

TEST(ShapeSurface, RadialShapesAreUniformByArea) {
  // Against the area by differences of positions alone, in eight octants. The steps are far below the finest chisel
  // marks (768 waves per unit), which a triangulation would have to resolve: at 400 x 800 it lost 5 % of the area.
  for (const char* name : {"bumpy-sphere", "statue"}) {
    const auto s = shape_surface(name, false);
    const bool statue = std::string(name) == "statue";
    const auto f = statue ? scatter_detail::draped_figure() : scatter_detail::bumps();
    const Vec3 scale = statue ? Vec3{0.55, 0.45, 1.4} : Vec3{1, 1, 1};
    const auto place = [&](double z, double turn) {
      const auto [sine, cosine] = scatter_detail::sincos_turns(turn);
      const double across = std::sqrt(std::max(0.0, 1 - z * z));
      const Vec3 d{across * cosine, across * sine, z};
      const double r = f->at(d).radius;
      return Vec3{scale[0] * r * d[0], scale[1] * r * d[1], scale[2] * r * d[2]};
    };
    std::vector<double> area(8), seen(8);
    const auto octant = [](const Vec3& p) {
      return static_cast<std::size_t>((p[0] > 0) + 2 * (p[1] > 0) + 4 * (p[2] > 0));
    };
    // One place in each cell of a grid over the sphere, the grid's phase moving on so that it resonates with no wave.
    constexpr int kRows = 400;
    constexpr double kStep = 1e-7, kCell = 1.0 / (static_cast<double>(kRows) * kRows);
    for (int i = 0; i < kRows; ++i)
      for (int k = 0; k < 2 * kRows; ++k) {
        const double jitter = 0.6180339887498949 * i + 0.7548776662466927 * k;
        const double z = -1 + 2 * (i + 0.01 + 0.98 * (jitter - std::floor(jitter))) / kRows;
        const double twist = 0.5698402909980532 * (i + k);
        const double turn = (k + twist - std::floor(twist)) / (2.0 * kRows);
        const Vec3 along = place(z + kStep, turn) - place(z - kStep, turn);
        const Vec3 around = place(z, turn + kStep) - place(z, turn - kStep);
        area[octant(place(z, turn))] += kCell * norm(cross(along, around)) / (4 * kStep * kStep);
      }
    double total = 0;
    for (const double a : area) total += a;
    EXPECT_NEAR(s->area(), total, 0.02 * total) << name;
    constexpr int kCount = 80000;
    for (std::uint64_t i = 0; i < kCount; ++i) {
      const auto p = at(*s, i);
      ++seen[octant(p.position)];
      EXPECT_NEAR(norm(p.normal), 1, 1e-12);
    }
    for (std::size_t k = 0; k < 8; ++k)
      EXPECT_NEAR(seen[k] / kCount, area[k] / total, 0.03 * 0.125 + 0.004) << name << " octant " << k;
  }
}

TEST(ShapeSurface, PointsLieInTheBoxAndHaveColoursOnRequest) {
  for (const auto& name : shape_names()) {
    EXPECT_FALSE(shape_surface(name, false)->has_colour());
    const auto s = shape_surface(name, true);
    ASSERT_TRUE(s->has_colour());
    const auto box = s->box();
    for (std::uint64_t i = 0; i < 1000; ++i) {
      const auto p = at(*s, i);
      for (std::size_t k = 0; k < 3; ++k) {
        EXPECT_GE(p.position[k], box.low[k] - 1e-3);
        EXPECT_LE(p.position[k], box.high[k] + 1e-3);
        EXPECT_GE(p.colour[k], 0);
        EXPECT_LE(p.colour[k], 255);
      }
    }
  }
}

}  // namespace
}  // namespace lamina

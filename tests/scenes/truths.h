// Things to scan, as meshes whose faces are the truth. Lengths as in the scenes: metres, or of no unit.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <vector>

#include "lamina/mesh.h"
#include "meshes/vec3.h"

namespace lamina::test::scenes {

using namespace meshes;

inline void add_quad(TriangleMesh& mesh, const std::array<Vec3, 4>& corners) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), corners.begin(), corners.end());
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first, first + 2, first + 3});
}

/// A closed tube around a trefoil, 6 across, with ripples: smooth, curved both ways, with a hollow no view sees into.
inline TriangleMesh knot_truth() {
  constexpr int kAround = 600, kAcross = 80;
  constexpr double kTurn = 2 * std::numbers::pi;
  const auto centre = [](double t) -> Vec3 {
    return {std::sin(t) + 2 * std::sin(2 * t), std::cos(t) - 2 * std::cos(2 * t), -std::sin(3 * t)};
  };
  const auto at = [&](int i, int j) -> Vec3 {
    const double u = kTurn * (i % kAround) / kAround, v = kTurn * (j % kAcross) / kAcross;
    const Vec3 along = unit(centre(u + 1e-4) - centre(u - 1e-4));
    const Vec3 first = unit(cross(along, Vec3{0, 0, 1})), second = cross(first, along);
    const double radius = 0.5 + 0.04 * std::cos(9 * u) * std::cos(4 * v);
    return centre(u) + (radius * std::cos(v)) * first + (-radius * std::sin(v)) * second;
  };
  TriangleMesh mesh;
  for (int i = 0; i < kAround; ++i) {
    for (int j = 0; j < kAcross; ++j) add_quad(mesh, {at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)});
  }
  return mesh;
}

/// A box of matter, or of air where `solid` is false; of several that overlap the last one counts.
struct Block {
  Vec3 low, high;
  bool solid = true;
};

/// The faces between matter and air, cut into pieces no longer than `finest` and bent.
inline TriangleMesh block_mesh(
    const std::vector<Block>& blocks, double finest,
    const std::function<Vec3(const Vec3&)>& bend = [](const Vec3& p) { return p; }) {
  std::array<std::vector<double>, 3> cuts;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<double> planes;
    for (const Block& b : blocks) planes.insert(planes.end(), {b.low[axis], b.high[axis]});
    std::sort(planes.begin(), planes.end());
    for (const double p : planes) {
      if (!cuts[axis].empty()) {
        const double from = cuts[axis].back();
        if (p - from < 1e-9) continue;
        const int pieces = std::max(1, static_cast<int>(std::ceil((p - from) / finest)));
        for (int k = 1; k < pieces; ++k) cuts[axis].push_back(from + (p - from) * k / pieces);
      }
      cuts[axis].push_back(p);
    }
  }
  using Index = std::array<std::size_t, 3>;
  const Index counts{cuts[0].size() - 1, cuts[1].size() - 1, cuts[2].size() - 1};
  const auto solid = [&](const Index& cell) {  // an index below 0 has wrapped around and is large
    for (std::size_t a = 0; a < 3; ++a) {
      if (cell[a] >= counts[a]) return false;
    }
    bool inside = false;
    for (const Block& b : blocks) {
      bool within = true;
      for (std::size_t a = 0; a < 3 && within; ++a) {
        const double middle = (cuts[a][cell[a]] + cuts[a][cell[a] + 1]) / 2;
        within = b.low[a] < middle && middle < b.high[a];
      }
      if (within) inside = b.solid;
    }
    return inside;
  };
  TriangleMesh mesh;
  const auto add_face = [&](const Index& cell, std::size_t axis, bool upper) {
    Index next = cell;
    next[axis] += upper ? 1 : std::size_t(-1);
    if (solid(next)) return;
    const auto corner = [&](std::size_t du, std::size_t dv) {
      Index c = cell;
      c[axis] += upper ? 1 : 0;
      c[(axis + 1) % 3] += du;
      c[(axis + 2) % 3] += dv;
      return bend({cuts[0][c[0]], cuts[1][c[1]], cuts[2][c[2]]});
    };
    const Vec3 a = corner(0, 0), b = corner(1, 0), c = corner(1, 1), d = corner(0, 1);
    if (upper)
      add_quad(mesh, {a, b, c, d});
    else
      add_quad(mesh, {a, d, c, b});
  };
  for (std::size_t k = 0; k < counts[2]; ++k) {
    for (std::size_t j = 0; j < counts[1]; ++j) {
      for (std::size_t i = 0; i < counts[0]; ++i) {
        if (!solid({i, j, k})) continue;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          for (const bool upper : {false, true}) add_face({i, j, k}, axis, upper);
        }
      }
    }
  }
  return mesh;
}

/// The front of a house, y up, z towards the street: six windows in deep reveals with sills, a cornice, steps before a
/// recessed door, and the street.
inline TriangleMesh facade_truth() {
  std::vector<Block> blocks{
      {{-6, -0.3, -2}, {6, 0, 6}}, {{-4.5, 0, -2}, {4.5, 6, 0}}, {{-4.7, 5.6, -2}, {4.7, 6, 0.4}}};
  for (const double y : {0.9, 3.4}) {
    for (const double x : {-3.2, 0.0, 3.2}) {
      if (y < 1 && x == 0) continue;  // the door
      blocks.push_back({{x - 0.6, y, -0.5}, {x + 0.6, y + 1.6, 0.1}, false});
      blocks.push_back({{x - 0.8, y - 0.2, -0.1}, {x + 0.8, y, 0.3}});
    }
  }
  blocks.push_back({{-0.7, 0.6, -0.7}, {0.7, 2.8, 0.1}, false});
  for (int step = 0; step < 3; ++step) blocks.push_back({{-1.2, 0, 0}, {1.2, 0.2 * (step + 1), 1.6 - 0.4 * step}});
  return block_mesh(blocks, 2);
}

/// A room seen from inside, y up: a doorway, a table, a cupboard, a shelf of boards.
inline TriangleMesh room_truth() {
  std::vector<Block> blocks{{{-0.3, -0.3, -0.3}, {4.3, 2.8, 3.3}}, {{0, 0, 0}, {4, 2.5, 3}, false}};
  blocks.push_back({{4, 0, 1}, {4.3, 2, 1.9}, false});
  blocks.push_back({{1.3, 0.66, 1.1}, {2.7, 0.74, 1.9}});
  for (const double x : {1.35, 2.55}) {
    for (const double z : {1.15, 1.75}) blocks.push_back({{x, 0, z}, {x + 0.1, 0.66, z + 0.1}});
  }
  blocks.push_back({{0, 0, 0}, {0.5, 1.8, 1.1}});
  for (const double y : {0.8, 1.3, 1.8}) blocks.push_back({{1.5, y, 2.7}, {3.2, y + 0.06, 3}});
  return block_mesh(blocks, 1);
}

/// A bent plate of the thickness, 1 x 0.8, with a square hole.
inline TriangleMesh plate_truth(double thickness) {
  return block_mesh({{{-0.5, -0.4, 0}, {0.5, 0.4, thickness}}, {{0.1, -0.1, 0}, {0.3, 0.1, thickness}, false}}, 0.02,
                    [](const Vec3& p) -> Vec3 {
                      return {p[0], p[1], p[2] + 0.12 * p[0] * p[0] - 0.05 * p[1] * p[1]};
                    });
}

/// Hills with terraces, z up: level ground of one facing a step apart. The rises are 0.06 to 0.24 high.
inline TriangleMesh terrain_truth() {
  std::vector<Block> blocks{{{-3, -2, -0.5}, {3, 2, 0}}};
  for (int step = 0; step < 4; ++step) {
    const double from = -1.6 + 0.9 * step, height = 0.06 * (step + 1) * (step + 2) / 2;
    blocks.push_back({{from, -1.5 + 0.2 * step, -0.5}, {3, 2, height}});
  }
  blocks.push_back({{-2.4, -1.7, 0}, {-2.0, 1.8, 0.12}});  // a kerb
  return block_mesh(blocks, 0.1, [](const Vec3& p) -> Vec3 {
    return {p[0], p[1], p[2] + 0.25 * std::sin(1.3 * p[0] + 0.4) * std::cos(1.1 * p[1])};
  });
}

}  // namespace lamina::test::scenes

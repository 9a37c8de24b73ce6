// Projected clouds and their trusted corners by place: what tests of the repair of untrusted corners start from.
#pragma once
#include <map>
#include <vector>

#include "mls/project.h"
#include "support/random_cloud.h"
#include "support/streamed_cloud.h"
#include "support/window_contents.h"

namespace lamina::test {

struct ProjectedScene {
  CloudSettings cloud;
  Lattice lattice;
};

/// Sparse enough that many corners have no trusted value of their own.
inline std::vector<ProjectedScene> projected_scenes() {
  std::vector<ProjectedScene> out{{{Shape::sphere, 300, {-300, 700, 50}, 600, 70, 350}, {64, 3}},
                                  {{Shape::torus, 250, {5000, 0, -5000}, 700, 60, 400}, {50, 5}},
                                  {{Shape::plane, 120, {64, 64, 64}, 700, 120, 160}, {96, 2}},
                                  {{Shape::scatter, 150, {0, 0, 0}, 500, 70, 300}, {61, 3}}};
  out[0].cloud.attributes = 2;
  out[1].cloud.noise = 0.1;
  out[1].cloud.attributes = 1;
  return out;
}

inline void project_all(StreamedCloud& s) {
  Projector projector({}, select_kernel());
  for (std::int32_t slab = s.first; slab < s.end; ++slab) projector.project(s.window, slab, s.feed);
}

/// A corner as projection left it.
struct OwnValue {
  bool seen = false, trusted = false;
  std::vector<double> channels;
};

/// The active corners of a level.
inline std::map<Cell, OwnValue> own_values(const Window& window, int level, std::int32_t first, std::int32_t end) {
  std::map<Cell, OwnValue> out;
  for_set(window, level, first, end, &CornerBlock::active,
          [&](int, const Cell& c, const CornerBlock& leaf, int offset) {
            OwnValue& v = out[c];
            v.seen = leaf.seen.test(offset);
            v.trusted = leaf.trusted.test(offset);
            const CornerValues& values = leaf.values[window.slab_in_leaf(level, offset >> 6)];
            const std::uint32_t i = leaf.value_index(offset, window.slab_layers(level));
            for (int channel = 0; channel < window.channels(); ++channel)
              v.channels.push_back(values.channel(channel)[i]);
          });
  return out;
}

/// Calls f(neighbour's value, weight 1 / m^2, distance of the neighbour's plane at the corner) for trusted neighbours.
template <typename F>
void for_trusted_neighbours(const std::map<Cell, OwnValue>& values, const Cell& corner, double cell, const F& f) {
  for (int i = 0; i < 27; ++i) {
    const Cell d{i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
    const int m = std::abs(d.x) + std::abs(d.y) + std::abs(d.z);
    const auto found = values.find(corner + d);
    if (m == 0 || found == values.end() || !found->second.trusted) continue;
    const std::vector<double>& v = found->second.channels;
    // The corner lies at -d from its neighbour.
    const double plane = v[kDistance] - cell * (v[kNormalX] * d.x + v[kNormalY] * d.y + v[kNormalZ] * d.z);
    f(found->second, 1.0 / (m * m), plane, d);
  }
}

}  // namespace lamina::test

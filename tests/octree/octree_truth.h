// The octree that samples ask for, by definition: cell by cell over all samples, in plain integers.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>
#include <set>
#include <vector>

#include "octree/refine.h"

namespace lamina::test {

class OctreeTruth {
 public:
  struct Level {
    std::set<Cell> nodes;  ///< existing cells, subdivided or not
    std::set<Cell> split, cells, corners, shared, active;
  };
  std::vector<Level> levels;

  /// From a sample to a corner of its level, steps; infinite to those that no sample marks, however far it acts.
  static double distance(const Lattice& lattice, const Mark& m, const Cell& corner) {
    const std::int32_t a = lattice.cell_size(m.level);
    const auto axis = [a](std::int32_t v, std::int32_t at) {
      const std::int32_t home = floor_div(v, a);
      if (at < home - 1 || at > home + 2) return std::numeric_limits<double>::infinity();
      return static_cast<double>(at) * a - v;
    };
    return std::hypot(axis(m.x, corner.x), axis(m.y, corner.y), axis(m.z, corner.z));
  }
  /// Of a corner above a sample's tangent plane, cells of its level.
  static double height(const Lattice& lattice, const Mark& m, const Cell& corner) {
    const double a = lattice.cell_size(m.level);
    return ((corner.x - m.x / a) * static_cast<double>(m.normal[0]) +
            (corner.y - m.y / a) * static_cast<double>(m.normal[1]) +
            (corner.z - m.z / a) * static_cast<double>(m.normal[2]));
  }

  OctreeTruth(const Lattice& lattice, const std::vector<Mark>& marks) : lattice_(lattice) {
    levels.resize(static_cast<std::size_t>(lattice.levels));
    for (const Mark& m : marks) {
      const std::int32_t a = lattice.cell_size(m.level);
      samples_.push_back({m.level, {floor_div(m.x, a), floor_div(m.y, a), floor_div(m.z, a)}, m});
    }
    const int top = lattice.levels - 1;
    for (const Sample& s : samples_) {
      // Whatever reaches three cells of its own level lies within three of the coarsest.
      const Cell home{s.home.x >> (top - s.level), s.home.y >> (top - s.level), s.home.z >> (top - s.level)};
      for_around(home, -3, 3, [&](const Cell& c) { visit(top, c); });
    }
    for (Level& l : levels) {
      for (const Cell& c : l.cells) for_around(c, 0, 1, [&](const Cell& corner) { l.corners.insert(corner); });
    }
    for (int l = 0; l <= top; ++l) find_near(l);
  }

 private:
  struct Sample {
    int level;
    Cell home;  ///< the cell of its level it lies in
    Mark mark;
  };
  template <typename F>
  static void for_around(const Cell& c, int lo, int hi, const F& f) {
    for (int z = lo; z <= hi; ++z) {
      for (int y = lo; y <= hi; ++y) {
        for (int x = lo; x <= hi; ++x) f(c + Cell{x, y, z});
      }
    }
  }
  /// Whether a sample's home is at most `reach` cells of the sample's level away from the cell, or from the cell of
  /// that level that contains it.
  static bool reaches(const Sample& s, int level, const Cell& c, int reach) {
    const auto axis = [&](std::int32_t home, std::int32_t at) {
      if (s.level >= level) return std::abs((at >> (s.level - level)) - home) <= reach;
      const std::int32_t size = std::int32_t{1} << (level - s.level);
      return home >= at * size - reach && home < (at + 1) * size + reach;
    };
    return axis(s.home.x, c.x) && axis(s.home.y, c.y) && axis(s.home.z, c.z);
  }
  void visit(int level, const Cell& c) {
    Level& here = levels[static_cast<std::size_t>(level)];
    if (!here.nodes.insert(c).second) return;
    const bool split = std::any_of(samples_.begin(), samples_.end(),
                                   [&](const Sample& s) { return s.level < level && reaches(s, level, c, 3); });
    if (split) {
      here.split.insert(c);
      for_around({c.x * 2, c.y * 2, c.z * 2}, 0, 1, [&](const Cell& child) { visit(level - 1, child); });
    } else if (std::any_of(samples_.begin(), samples_.end(),
                           [&](const Sample& s) { return s.level >= level && reaches(s, level, c, 3); })) {
      here.cells.insert(c);
    }
  }
  void find_near(int level) {
    Level& here = levels[static_cast<std::size_t>(level)];
    for (const Cell& corner : here.corners) {
      // The next finer level that holds it tells; those in between need not hold it.
      Cell fine = corner;
      int finer = level - 1;
      for (; finer >= 0; --finer) {
        fine = {fine.x * 2, fine.y * 2, fine.z * 2};
        if (levels[static_cast<std::size_t>(finer)].corners.contains(fine)) break;
      }
      if (finer >= 0) {
        here.shared.insert(corner);
        if (levels[static_cast<std::size_t>(finer)].active.contains(fine)) here.active.insert(corner);
        continue;
      }
      bool active = std::any_of(samples_.begin(), samples_.end(), [&](const Sample& s) {
        return s.level == level && distance(lattice_, s.mark, corner) < static_cast<double>(s.mark.active_radius) &&
               std::abs(height(lattice_, s.mark, corner)) < static_cast<double>(s.mark.active_height);
      });
      for_around(corner, -1, 0, [&](const Cell& c) {
        active =
            active || (here.nodes.contains(c) && std::any_of(samples_.begin(), samples_.end(), [&](const Sample& s) {
                         return s.level > level && reaches(s, level, c, 1);
                       }));
      });
      if (active) here.active.insert(corner);
    }
  }

  Lattice lattice_;
  std::vector<Sample> samples_;
};

}  // namespace lamina::test

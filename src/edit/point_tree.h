// Nearest and near points: a balanced kd-tree over a set of positions in double (samples/sample_tree.h is the one for k
// nearest samples of a window).
#pragma once
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

namespace lamina::edit {

struct NearestPoint {
  double squared_distance = std::numeric_limits<double>::infinity();
  std::uint32_t point = 0;
};

/// Positions in double, 32 bytes per point. Queries may run on any number of threads.
class PointTree {
 public:
  using Position = std::array<double, 3>;
  /// Wants finite positions, fewer than 2^32.
  explicit PointTree(const std::vector<Position>& positions);

  /// The nearest point closer than the squared distance `bound`; of equally near ones the first. Without one,
  /// squared_distance stays at `bound`.
  [[nodiscard]] NearestPoint nearest(const Position& p, double bound = std::numeric_limits<double>::infinity()) const;

  /// Calls visit(point, squared distance) for every point within `squared_radius`, in an order that depends on the set
  /// alone.
  template <class Visit>
  void within(const Position& p, double squared_radius, const Visit& visit) const {
    if (!nodes_.empty()) within(p, squared_radius, visit, 0, nodes_.size());
  }

 private:
  static constexpr std::size_t kAlone = 4096;  ///< points one thread arranges
  struct Node {
    Position position;
    std::uint32_t point = 0;
    std::uint8_t axis = 0;  ///< the node divides its range along it
  };
  static double squared(double v) { return v * v; }
  static double squared_distance(const Position& a, const Position& b) {
    return squared(a[0] - b[0]) + squared(a[1] - b[1]) + squared(a[2] - b[2]);
  }
  void build(std::size_t first, std::size_t end);
  void search(const Position& p, std::size_t first, std::size_t end, NearestPoint& best) const;

  /// A range's middle node divides it: lower ones before it, higher ones behind.
  template <class Visit>
  void within(const Position& p, double squared_radius, const Visit& visit, std::size_t first, std::size_t end) const {
    while (first < end) {
      const std::size_t middle = first + (end - first) / 2;
      const Node& node = nodes_[middle];
      const double d2 = squared_distance(p, node.position);
      if (d2 <= squared_radius) visit(node.point, d2);
      const double side = p[node.axis] - node.position[node.axis];
      const bool both = side * side <= squared_radius;
      if (both) within(p, squared_radius, visit, first, middle);
      if (side < 0 && !both) {
        end = middle;
      } else {
        first = middle + 1;
      }
    }
  }

  std::vector<Node> nodes_;
};

inline PointTree::PointTree(const std::vector<Position>& positions) : nodes_(positions.size()) {
  for (std::size_t i = 0; i < positions.size(); ++i) nodes_[i] = {positions[i], static_cast<std::uint32_t>(i), 0};
  build(0, nodes_.size());
}

inline void PointTree::build(std::size_t first, std::size_t end) {
  if (end - first < 2) return;
  Position low = nodes_[first].position, high = low;
  for (std::size_t i = first; i < end; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], nodes_[i].position[k]);
      high[k] = std::max(high[k], nodes_[i].position[k]);
    }
  }
  std::uint8_t axis = 0;
  for (std::uint8_t k = 1; k < 3; ++k)
    if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
  const std::size_t middle = first + (end - first) / 2;
  const auto at = [&](std::size_t i) { return nodes_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(first), at(middle), at(end), [axis](const Node& a, const Node& b) {
    return a.position[axis] != b.position[axis] ? a.position[axis] < b.position[axis] : a.point < b.point;
  });
  nodes_[middle].axis = axis;
  if (end - first < kAlone) {
    build(first, middle);
    build(middle + 1, end);
  } else {
    tbb::parallel_invoke([&] { build(first, middle); }, [&] { build(middle + 1, end); });
  }
}

inline void PointTree::search(const Position& p, std::size_t first, std::size_t end, NearestPoint& best) const {
  if (first >= end) return;
  const std::size_t middle = first + (end - first) / 2;
  const Node& node = nodes_[middle];
  const double d2 = squared_distance(p, node.position);
  if (d2 < best.squared_distance || (d2 == best.squared_distance && node.point < best.point)) best = {d2, node.point};
  const double side = p[node.axis] - node.position[node.axis];
  const bool low_first = side < 0;
  low_first ? search(p, first, middle, best) : search(p, middle + 1, end, best);
  // Equally near ones on the other side may come earlier.
  if (side * side <= best.squared_distance)
    low_first ? search(p, middle + 1, end, best) : search(p, first, middle, best);
}

inline NearestPoint PointTree::nearest(const Position& p, double bound) const {
  NearestPoint best{bound, 0};
  search(p, 0, nodes_.size(), best);
  return best;
}

}  // namespace lamina::edit

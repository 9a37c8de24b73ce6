// Nearest and near points: a balanced kd-tree over a set of positions in double (samples/sample_tree.h is the one for k
// nearest samples of a window).
#pragma once
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

}  // namespace lamina::edit

#include "edit/point_tree.h"

#include <tbb/parallel_invoke.h>

#include <algorithm>

namespace lamina::edit {
namespace {
constexpr std::size_t kAlone = 4096;  // points one thread arranges
}

PointTree::PointTree(const std::vector<Position>& positions) : nodes_(positions.size()) {
  for (std::size_t i = 0; i < positions.size(); ++i) nodes_[i] = {positions[i], static_cast<std::uint32_t>(i), 0};
  build(0, nodes_.size());
}

void PointTree::build(std::size_t first, std::size_t end) {
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

void PointTree::search(const Position& p, std::size_t first, std::size_t end, NearestPoint& best) const {
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

NearestPoint PointTree::nearest(const Position& p, double bound) const {
  NearestPoint best{bound, 0};
  search(p, 0, nodes_.size(), best);
  return best;
}

}  // namespace lamina::edit

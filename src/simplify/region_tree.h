// Where a mesh is cut into regions, each of which fits memory.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "meshes/vec3.h"

namespace lamina::simplify {

/// Boxes, cut across the longest side of what lies in them.
class RegionTree {
 public:
  /// A single one.
  RegionTree() : nodes_(1) {}
  /// Boxes of at most `most` of these places; `share` of them below a cut, above 0 and below 1: another share, other
  /// boxes.
  RegionTree(std::vector<meshes::Vec3> places, std::size_t most, double share);

  [[nodiscard]] std::uint32_t regions() const { return regions_; }
  [[nodiscard]] std::uint32_t at(const meshes::Vec3& place) const {
    const Node* node = nodes_.data();
    while (node->high != 0) node = &nodes_[place[node->axis] < node->cut ? node->low : node->high];
    return node->low;
  }

 private:
  struct Node {
    double cut = 0;
    std::size_t axis = 0;
    std::uint32_t low = 0, high = 0;  ///< nodes; of a leaf the region and 0
  };
  void divide(std::uint32_t node, std::span<meshes::Vec3> places, std::size_t most, double share);

  std::vector<Node> nodes_;
  std::uint32_t regions_ = 1;
};

}  // namespace lamina::simplify

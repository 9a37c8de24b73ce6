// Space cut into boxes, and a mesh with it.
#pragma once
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "meshes/vec3.h"

namespace lamina::simplify {

/// Boxes, cut across the longest side of what lies in them.
class BoxTree {
 public:
  /// A single one.
  BoxTree() : nodes_(1) {}
  /// Boxes of at most `most` of these places; `share` of them below a cut, above 0 and below 1: another share, other
  /// boxes.
  BoxTree(std::vector<meshes::Vec3> places, std::size_t most, double share);

  [[nodiscard]] std::uint32_t boxes() const { return boxes_; }
  [[nodiscard]] std::uint32_t at(const meshes::Vec3& place) const {
    const Node* node = nodes_.data();
    while (node->high != 0) node = &nodes_[place[node->axis] < node->cut ? node->low : node->high];
    return node->low;
  }

 private:
  struct Node {
    double cut = 0;
    std::size_t axis = 0;
    std::uint32_t low = 0, high = 0;  ///< nodes; of a leaf the box and 0
  };
  void divide(std::uint32_t node, std::span<meshes::Vec3> places, std::size_t most, double share);

  std::vector<Node> nodes_;
  std::uint32_t boxes_ = 1;
};

inline BoxTree::BoxTree(std::vector<meshes::Vec3> places, std::size_t most, double share) : nodes_(1) {
  boxes_ = 0;
  divide(0, places, std::max<std::size_t>(most, 1), share);
}

inline void BoxTree::divide(std::uint32_t node, std::span<meshes::Vec3> places, std::size_t most, double share) {
  const auto end_here = [&] { nodes_[node].low = boxes_++; };
  if (places.size() <= most) return end_here();
  meshes::Vec3 low = places[0], high = low;
  for (const meshes::Vec3& p : places) {
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], p[k]);
      high[k] = std::max(high[k], p[k]);
    }
  }
  std::size_t axis = 0;
  for (std::size_t k = 1; k < 3; ++k) {
    if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
  }
  if (!(high[axis] > low[axis])) return end_here();
  const auto wanted =
      std::clamp<std::ptrdiff_t>(static_cast<std::ptrdiff_t>(share * static_cast<double>(places.size())), 1,
                                 static_cast<std::ptrdiff_t>(places.size()) - 1);
  std::nth_element(places.begin(), places.begin() + wanted, places.end(),
                   [axis](const meshes::Vec3& a, const meshes::Vec3& b) { return a[axis] < b[axis]; });
  double cut = places[static_cast<std::size_t>(wanted)][axis];
  if (!(cut > low[axis])) {  // many lie at the lower end
    cut = high[axis];
    for (const meshes::Vec3& p : places) {
      if (p[axis] > low[axis]) cut = std::min(cut, p[axis]);
    }
  }
  const auto above =
      std::partition(places.begin(), places.end(), [axis, cut](const meshes::Vec3& p) { return p[axis] < cut; });
  const auto below = static_cast<std::size_t>(above - places.begin());
  const auto first = static_cast<std::uint32_t>(nodes_.size());
  nodes_[node] = {cut, axis, first, first + 1};
  nodes_.resize(nodes_.size() + 2);
  divide(first, places.first(below), most, share);
  divide(first + 1, places.subspan(below), most, share);
}

/// Cuts triangles 0 to their number into boxes of about `most`, `share` as above; `place(triangle)`: where it is. A
/// sample of them says where. `order`: triangles box by box, in each by number. Returns where each box begins, and the
/// end. The result does not depend on the number of threads.
template <class Place>
std::vector<std::size_t> cut_into_boxes(std::size_t triangles, const Place& place, std::size_t most, double share,
                                        std::vector<std::uint32_t>& order) {
  constexpr std::size_t kSample = 2'048;  // of a box
  const std::size_t stride = std::max<std::size_t>(most / kSample, 1);
  BoxTree tree;
  if (triangles > most) {
    std::vector<meshes::Vec3> sample;
    for (std::size_t t = 0; t < triangles; t += stride) sample.push_back(place(t));
    tree = BoxTree(std::move(sample), most / stride, share);
  }
  std::vector<std::uint32_t> box(triangles);
  tbb::parallel_for(std::size_t{0}, triangles, [&](std::size_t t) { box[t] = tree.at(place(t)); });
  std::vector<std::size_t> starts(tree.boxes() + std::size_t{1});
  for (const std::uint32_t b : box) ++starts[b + 1];
  for (std::size_t b = 0; b + 1 < starts.size(); ++b) starts[b + 1] += starts[b];
  std::vector<std::size_t> next = starts;
  order.resize(triangles);
  for (std::uint32_t t = 0; t < triangles; ++t) order[next[box[t]]++] = t;
  return starts;
}

}  // namespace lamina::simplify

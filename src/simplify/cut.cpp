#include "simplify/cut.h"

namespace lamina::simplify {

BoxTree::BoxTree(std::vector<meshes::Vec3> places, std::size_t most, double share) : nodes_(1) {
  boxes_ = 0;
  divide(0, places, std::max<std::size_t>(most, 1), share);
}

void BoxTree::divide(std::uint32_t node, std::span<meshes::Vec3> places, std::size_t most, double share) {
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

}  // namespace lamina::simplify

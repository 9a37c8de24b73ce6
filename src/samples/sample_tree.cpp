#include "samples/sample_tree.h"

#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <cstdint>
#include <vector>

namespace lamina {
namespace {

constexpr std::size_t kLeaf = 12;            ///< samples a leaf has at most
constexpr std::size_t kParallel = 1u << 14;  ///< smaller ranges are built by one thread

}  // namespace

struct SampleTree::Query : NearestList {
  std::array<float, 3> outside{};  ///< by axis: how far the node in question lies from the sample
};

SampleTree::SampleTree(std::span<const std::int32_t> x, std::span<const std::int32_t> y,
                       std::span<const std::int32_t> z) {
  static_assert(kMostInLeaf >= 2 * kLeaf + 2);
  const std::size_t n = x.size();
  std::vector<TreeItem> items(n);
  for (std::size_t i = 0; i < n; ++i) items[i] = {{x[i], y[i], z[i]}, static_cast<std::uint32_t>(i)};
  while ((n >> depth_) > kLeaf) ++depth_;
  nodes_.resize((std::size_t{1} << depth_) - 1);
  boxes_.resize(nodes_.size() + 1);
  if (n > 0) build(items, {0, 0, n, 0});
  order_.resize(n);
  for (auto& axis : at_) axis.resize(n + 3);
  for (std::size_t i = 0; i < n; ++i) {
    order_[i] = items[i].number;
    for (std::size_t a = 0; a < 3; ++a) at_[a][i] = items[i].at[a];
  }
}

void SampleTree::build(std::span<TreeItem> items, const Subtree& tree) {
  const ItemBox box = ItemBox::around(items.subspan(tree.begin, tree.end - tree.begin));
  if (tree.depth == depth_) {
    boxes_[tree.node - nodes_.size()] = box;
    return;
  }
  const std::size_t axis = box.longest_axis();
  MedianSplit(items, axis).select(tree.begin, tree.middle(), tree.end);
  nodes_[tree.node] = {items[tree.middle()].at[axis], static_cast<int>(axis)};
  if (tree.end - tree.begin > kParallel) {
    tbb::parallel_invoke([&] { build(items, tree.lower()); }, [&] { build(items, tree.upper()); });
  } else {
    build(items, tree.lower());
    build(items, tree.upper());
  }
}

std::size_t SampleTree::nearest(std::uint32_t place, std::size_t k, float bound, Neighbour* found) const {
  Query q;
  q.at = {at_[0][place], at_[1][place], at_[2][place]};
  q.place = place;
  q.wanted = std::min(k, kMostNeighbours);
  q.bound = bound;
  q.found = found;
  if (q.wanted > 0) search(q, whole(), 0.0F);
  return q.count;
}

SampleTree::Block SampleTree::block_of(std::uint32_t place) const {
  constexpr int kLevels = 2;  // above the leaves
  Subtree tree = whole();
  while (tree.depth < depth_ - kLevels) tree = place < tree.middle() ? tree.lower() : tree.upper();
  Block block{static_cast<std::uint32_t>(tree.begin), static_cast<std::uint32_t>(tree.end)};
  std::size_t first = tree.node;
  std::size_t count = 1;
  for (int depth = tree.depth; depth < depth_; ++depth) {
    first = 2 * first + 1;
    count *= 2;
  }
  first -= nodes_.size();
  block.box = boxes_[first];
  for (std::size_t leaf = first; leaf < first + count; ++leaf) block.box = block.box.with(boxes_[leaf]);
  return block;
}

void SampleTree::search(Query& q, const Subtree& tree, float squared) const {
  if (tree.depth == depth_) {
    q.take_places<kMostInLeaf>(axes(), tree.begin, tree.end);
    return;
  }
  const Node& split = nodes_[tree.node];
  const auto axis = static_cast<std::size_t>(split.axis);
  const auto side = static_cast<float>(q.at[axis] - split.split);
  // Where both halves touch the plane, what lies on it may be in either.
  const bool lower_first = side < 0 || (side == 0 && q.place < tree.middle());
  search(q, lower_first ? tree.lower() : tree.upper(), squared);
  // The other half is as far as the plane along this axis, and as the node itself along the others.
  const float before = q.outside[axis];
  const float there = squared - before * before + side * side;
  // Rounding must not hide a sample at the bound.
  constexpr float kSlack = 1 - 1e-5F;
  if (there * kSlack <= q.bound) {
    q.outside[axis] = side;
    search(q, lower_first ? tree.upper() : tree.lower(), there);
    q.outside[axis] = before;
  }
}

}  // namespace lamina

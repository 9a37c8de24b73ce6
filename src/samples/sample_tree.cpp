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

static_assert(SampleTree::kMostInLeaf >= 2 * kLeaf + 2);

/// The samples of a leaf, each with the nearest found so far.
struct SampleTree::LeafQuery {
  std::array<Query, kMostInLeaf> own;
  std::size_t count = 0;
  std::array<std::int32_t, 3> low{}, high{};  ///< box around them
  std::array<float, 3> outside{};             ///< by axis: how far the node in question lies from the box
  float bound = 0;                            ///< the largest of their own
};

SampleTree::SampleTree(std::span<const std::int32_t> x, std::span<const std::int32_t> y,
                       std::span<const std::int32_t> z) {
  const std::size_t n = x.size();
  std::vector<TreeItem> items(n);
  for (std::size_t i = 0; i < n; ++i) items[i] = {{x[i], y[i], z[i]}, static_cast<std::uint32_t>(i)};
  while ((n >> depth_) > kLeaf) ++depth_;
  nodes_.resize((std::size_t{1} << depth_) - 1);
  if (n > 0) build(items, {0, 0, n, 0});
  order_.resize(n);
  for (auto& axis : at_) axis.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    order_[i] = items[i].number;
    for (std::size_t a = 0; a < 3; ++a) at_[a][i] = items[i].at[a];
  }
}

void SampleTree::build(std::span<TreeItem> items, const Subtree& tree) {
  if (tree.depth == depth_) return;
  const std::size_t axis = ItemBox::around(items.subspan(tree.begin, tree.end - tree.begin)).longest_axis();
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

SampleTree::Places SampleTree::places_of(std::size_t leaf) const {
  Subtree tree = whole();
  for (int level = depth_ - 1; level >= 0; --level) tree = ((leaf >> level) & 1) == 0 ? tree.lower() : tree.upper();
  return {tree.begin, tree.end};
}

void SampleTree::nearest_to_leaf(std::size_t leaf, std::size_t k, float bound, Neighbour* found,
                                 std::size_t* counts) const {
  const Places places = places_of(leaf);
  LeafQuery q;
  q.count = places.size();
  q.bound = bound;
  for (std::size_t a = 0; a < 3; ++a) {
    const auto begin = at_[a].begin() + static_cast<std::ptrdiff_t>(places.begin);
    const auto [low, high] = std::minmax_element(begin, begin + static_cast<std::ptrdiff_t>(places.size()));
    q.low[a] = *low;
    q.high[a] = *high;
  }
  for (std::size_t i = 0; i < q.count; ++i) {
    Query& own = q.own[i];
    const std::size_t place = places.begin + i;
    own.at = {at_[0][place], at_[1][place], at_[2][place]};
    own.place = static_cast<std::uint32_t>(place);
    own.wanted = std::min(k, kMostNeighbours);
    own.bound = bound;
    own.found = found + i * k;
  }
  search(q, whole(), 0.0F);
  for (std::size_t i = 0; i < q.count; ++i) counts[i] = q.own[i].count;
}

void SampleTree::search(LeafQuery& q, const Subtree& tree, float squared) const {
  if (tree.depth == depth_) {
    q.bound = 0;
    for (std::size_t i = 0; i < q.count; ++i) {
      search(q.own[i], tree, squared);
      q.bound = std::max(q.bound, q.own[i].bound);
    }
    return;
  }
  const Node& split = nodes_[tree.node];
  const auto axis = static_cast<std::size_t>(split.axis);
  const auto to_lower = static_cast<float>(std::max(0, q.low[axis] - split.split));
  const auto to_upper = static_cast<float>(std::max(0, split.split - q.high[axis]));
  const float before = q.outside[axis];
  const auto visit = [&](const Subtree& half, float side) {
    // Farther along this axis than the plane, or as far as the node itself.
    const float farther = std::max(side, before);
    const float there = squared - before * before + farther * farther;
    constexpr float kSlack = 1 - 1e-5F;
    if (there * kSlack > q.bound) return;
    q.outside[axis] = farther;
    search(q, half, there);
    q.outside[axis] = before;
  };
  // The half that holds more of the box first; where it lies in both, the one with its middle.
  const std::int64_t middle = (std::int64_t{q.low[axis]} + q.high[axis]) / 2;
  if (middle <= split.split) {
    visit(tree.lower(), to_lower);
    visit(tree.upper(), to_upper);
  } else {
    visit(tree.upper(), to_upper);
    visit(tree.lower(), to_lower);
  }
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

#include "samples/sample_tree.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <cstdint>
#include <vector>

namespace lamina {
namespace {

constexpr std::size_t kLeaf = 12;            ///< samples a leaf has at most, one more where halves are not even
constexpr std::size_t kParallel = 1u << 14;  ///< smaller ranges are built by one thread
constexpr std::int32_t kOutside = (1 << 30) - 1;

}  // namespace

struct SampleTree::Query : NearestList {
  std::array<float, 3> outside{};  ///< by axis: how far the node in question lies from the sample
};

SampleTree::SampleTree(std::span<const std::int32_t> x, std::span<const std::int32_t> y,
                       std::span<const std::int32_t> z) {
  static_assert(kMostInLeaf > kLeaf);
  const std::size_t n = x.size();
  std::vector<TreeItem> items(n);
  const tbb::blocked_range<std::size_t> all(0, n, kParallel);
  tbb::parallel_for(all, [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i)
      items[i] = {{x[i], y[i], z[i]}, static_cast<std::uint32_t>(i)};
  });
  while ((n >> depth_) > 4 * kLeaf) ++depth_;
  nodes_.resize((std::size_t{1} << depth_) - 1);
  blocks_.resize(nodes_.size() + 1);
  build(items, {0, n}, {0, 0});
  order_.resize(n);
  for (auto& axis : at_) axis.resize(n + kSpare);
  tbb::parallel_for(all, [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      order_[i] = items[i].number;
      for (std::size_t a = 0; a < 3; ++a) at_[a][i] = items[i].at[a];
    }
  });
}

void SampleTree::build(std::span<TreeItem> items, const Range& range, const Below& below) {
  if (below.depth == depth_) {
    build_block(items, range, blocks_[below.node - nodes_.size()]);
    return;
  }
  const std::size_t middle = range.middle();
  const std::size_t axis = ItemBox::around(items.subspan(range.begin, range.end - range.begin)).longest_axis();
  MedianSplit(items, axis).select(range.begin, middle, range.end);
  nodes_[below.node] = {items[middle].at[axis], static_cast<int>(axis)};
  if (range.end - range.begin > kParallel) {
    tbb::parallel_invoke(
        [&] {
          build(items, {range.begin, middle}, below.lower());
        },
        [&] {
          build(items, {middle, range.end}, below.upper());
        });
  } else {
    build(items, {range.begin, middle}, below.lower());
    build(items, {middle, range.end}, below.upper());
  }
}

void SampleTree::build_block(std::span<TreeItem> items, const Range& range, Block& block) {
  std::array<Range, 4> leaves;
  leaves.fill({range.end, range.end});
  leaves[0] = range;
  const auto halve = [&](Range& first, Range& second) {
    if (first.end - first.begin <= kLeaf) return;
    const Range all = first;
    const std::size_t axis = ItemBox::around(items.subspan(all.begin, all.end - all.begin)).longest_axis();
    MedianSplit(items, axis).select(all.begin, all.middle(), all.end);
    first = {all.begin, all.middle()};
    second = {all.middle(), all.end};
  };
  halve(leaves[0], leaves[2]);
  halve(leaves[0], leaves[1]);
  if (leaves[2].begin < leaves[2].end) halve(leaves[2], leaves[3]);
  block.begin[4] = static_cast<std::uint32_t>(range.end);
  for (std::size_t leaf = 0; leaf < 4; ++leaf) {
    const auto [begin, end] = leaves[leaf];
    // What is in none lies outside of all.
    ItemBox box = ItemBox::of({kOutside, kOutside, kOutside});
    if (begin < end) box = ItemBox::around(items.subspan(begin, end - begin));
    for (std::size_t a = 0; a < 3; ++a) {
      block.low[a][leaf] = box.low[a];
      block.high[a][leaf] = box.high[a];
    }
  }
  // A leaf ends where the next one begins, an empty one where it begins.
  for (std::size_t leaf = 4; leaf-- > 0;)
    block.begin[leaf] =
        leaves[leaf].begin < leaves[leaf].end ? static_cast<std::uint32_t>(leaves[leaf].begin) : block.begin[leaf + 1];
}

unsigned SampleTree::Block::within(const ItemBox& box, float squared) const {
  std::array<FourFloats, 3> past;
  for (std::size_t a = 0; a < 3; ++a) {
    const FourInts below = low[a] - box.high[a];
    const FourInts above = box.low[a] - high[a];
    const FourInts more = below > above ? below : above;
    past[a] = to_floats(more > 0 ? more : FourInts{});
  }
  return bits_of(past[0] * past[0] + past[1] * past[1] + past[2] * past[2] <= squared);
}

unsigned SampleTree::Block::beyond(const std::array<std::int32_t, 3>& at, float squared) const {
  std::array<FourFloats, 3> far;
  for (std::size_t a = 0; a < 3; ++a) {
    const FourInts below = at[a] - low[a];
    const FourInts above = high[a] - at[a];
    far[a] = to_floats(below > above ? below : above);
  }
  return bits_of(far[0] * far[0] + far[1] * far[1] + far[2] * far[2] > squared);
}

ItemBox SampleTree::Block::box() const {
  ItemBox all = box_of(0);
  for (std::size_t i = 1; i < 4; ++i) {
    if (begin[i] < begin[i + 1]) all = all.with(box_of(i));
  }
  return all;
}

const SampleTree::Block& SampleTree::block_of(std::uint32_t place) const {
  Range range{0, order_.size()};
  Below below;
  while (below.depth < depth_) {
    const bool lower = place < range.middle();
    below = lower ? below.lower() : below.upper();
    (lower ? range.end : range.begin) = range.middle();
  }
  return block_at(below);
}

std::size_t SampleTree::nearest(std::uint32_t place, std::size_t k, float bound, Neighbour* found) const {
  Query q;
  q.at = position(place);
  q.place = place;
  q.wanted = std::min(k, kMostNeighbours);
  q.bound = bound;
  q.found = found;
  if (q.wanted > 0) search(q, {0, 0}, 0.0F);
  return q.count;
}

void SampleTree::search(Query& q, const Below& below, float squared) const {
  const PlacedAxes axes = this->axes();
  if (below.depth == depth_) {
    const Block& block = block_at(below);
    for (unsigned leaves = block.within(ItemBox::of(q.at), q.bound); leaves != 0; leaves &= leaves - 1) {
      const auto leaf = static_cast<std::size_t>(std::countr_zero(leaves));
      q.take_places<kMostInLeaf>(axes, block.begin[leaf], block.begin[leaf + 1]);
    }
    return;
  }
  const Node& split = nodes_[below.node];
  const auto axis = static_cast<std::size_t>(split.axis);
  const auto side = static_cast<float>(q.at[axis] - split.split);
  search(q, side < 0 ? below.lower() : below.upper(), squared);
  // The other half is as far as the plane along this axis, and as the node itself along the others.
  const float before = q.outside[axis];
  const float there = squared - before * before + side * side;
  // Rounding must not hide a sample at the bound.
  constexpr float kSlack = 1 - 1e-5F;
  if (there * kSlack <= q.bound) {
    q.outside[axis] = side;
    search(q, side < 0 ? below.upper() : below.lower(), there);
    q.outside[axis] = before;
  }
}

}  // namespace lamina

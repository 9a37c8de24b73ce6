// The nearest samples around a sample: a balanced kd-tree over the fixed-point positions of a window. Its own tree
// beside edit/point_tree.h, which asks for the one nearest of any positions: here every sample asks for its k nearest,
// so leaves hold a dozen samples side by side, lie four by four, and distances are sums of floats.
#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "base/four.h"
#include "samples/median_split.h"
#include "samples/nearest.h"

namespace lamina {

/// Samples are given places so that those of a leaf follow one another: whoever goes through the places in order finds
/// neighbours in the processor's cache. The order depends on the positions and their numbers alone, not on threads.
/// Queries may run on any number of threads.
class SampleTree {
 public:
  static constexpr std::size_t kMostNeighbours = 256;
  static constexpr std::size_t kSpare = 15;

  /// Wants three arrays of one length below 2^32, coordinates within +-(2^30 - 1).
  SampleTree(std::span<const std::int32_t> x, std::span<const std::int32_t> y, std::span<const std::int32_t> z);

  [[nodiscard]] std::size_t size() const { return order_.size(); }
  /// Number, in the arrays given, of the sample at each place.
  [[nodiscard]] const std::vector<std::uint32_t>& order() const { return order_; }

  /// The `k` (at most kMostNeighbours) nearest samples to the one at `place`, itself left out, that are not farther
  /// than the squared distance `bound`; nearest first, equally near ones by place. Returns how many there are.
  std::size_t nearest(std::uint32_t place, std::size_t k, float bound, Neighbour* found) const;

  /// Four samples, as seen from a position; some may lie infinitely far away and be none.
  struct FourSamples {
    std::array<FourFloats, 3> offset;  ///< offset()
    FourFloats squared;                ///< distance, steps^2
    FourInts places;
  };
  /// Between two squared distances of a sample, steps^2: farther than `inner`, not farther than `outer`.
  struct Shell {
    std::uint32_t place = 0;
    float inner = 0, outer = 0;
  };
  /// Calls visit(four) until all samples of the shell have been visited, in the order of places. Others come with them.
  template <class Visit>
  void fours_within(const Shell& shell, const Visit& visit) const {
    const std::array<std::int32_t, 3> at = position(shell.place);
    for_blocks({ItemBox::of(at), shell.outer}, [&](const Block& block) {
      unsigned leaves = block.within(ItemBox::of(at), shell.outer) & block.beyond(at, shell.inner);
      for (; leaves != 0; leaves &= leaves - 1) {
        const auto leaf = static_cast<std::size_t>(std::countr_zero(leaves));
        fours_of(at, block.begin[leaf], block.begin[leaf + 1], visit);
      }
    });
  }
  /// Calls visit(four) for the samples at places [begin, end), as seen from a position.
  template <class Visit>
  void fours_of(const std::array<std::int32_t, 3>& at, std::size_t begin, std::size_t end, const Visit& visit) const {
    for (std::size_t p = begin; p < end; p += 4) {
      FourSamples four;
      four.places = four_times(static_cast<std::int32_t>(p)) + FourInts{0, 1, 2, 3};
      for (std::size_t a = 0; a < 3; ++a) four.offset[a] = to_floats(load_four(at_[a].data() + p) - at[a]);
      const auto& d = four.offset;
      const FourInts is_sample = four.places < static_cast<std::int32_t>(end);
      four.squared =
          is_sample ? d[0] * d[0] + d[1] * d[1] + d[2] * d[2] : FourFloats{} + std::numeric_limits<float>::infinity();
      visit(four);
    }
  }

  /// Four leaves side by side, a lane each, some of them empty in small trees: leaf i holds places
  /// [begin[i], begin[i + 1]).
  struct Block {
    std::array<FourInts, 3> low, high;
    std::array<std::uint32_t, 5> begin;

    /// A bit for each leaf that comes within a squared distance of a box.
    [[nodiscard]] unsigned within(const ItemBox& box, float squared) const;
    /// A bit for each leaf that reaches farther than a squared distance from a position.
    [[nodiscard]] unsigned beyond(const std::array<std::int32_t, 3>& at, float squared) const;
    [[nodiscard]] ItemBox box() const;
    [[nodiscard]] ItemBox box_of(std::size_t leaf) const {
      return ItemBox{{low[0][leaf], low[1][leaf], low[2][leaf], 0}, {high[0][leaf], high[1][leaf], high[2][leaf], 0}};
    }
    [[nodiscard]] bool holds(std::uint32_t place) const { return place >= begin.front() && place < begin.back(); }
  };
  [[nodiscard]] const Block& block_of(std::uint32_t place) const;
  /// Within a squared distance of a box.
  struct Around {
    ItemBox box;
    float squared;
  };
  /// Calls visit(block) for all blocks that may hold such samples, and maybe others, in the order of places.
  template <class Visit>
  void for_blocks(const Around& around, const Visit& visit) const {
    for_blocks(around, {}, visit, {0, 0});
  }

  [[nodiscard]] std::array<std::int32_t, 3> position(std::uint32_t place) const {
    return {at_[0][place], at_[1][place], at_[2][place]};
  }
  /// Positions by place; behind the last one there are some more numbers, so that kSpare more can be loaded.
  [[nodiscard]] PlacedAxes axes() const { return {at_[0].data(), at_[1].data(), at_[2].data()}; }
  /// From the sample at place `a` to that at place `b`, steps.
  [[nodiscard]] std::array<float, 3> offset(std::uint32_t a, std::uint32_t b) const {
    return {static_cast<float>(at_[0][b] - at_[0][a]), static_cast<float>(at_[1][b] - at_[1][a]),
            static_cast<float>(at_[2][b] - at_[2][a])};
  }
  /// The same to the samples at four places.
  [[nodiscard]] std::array<FourFloats, 3> offsets(std::uint32_t a, const std::uint32_t* places) const {
    std::array<FourFloats, 3> offsets;
    for (std::size_t axis = 0; axis < 3; ++axis) offsets[axis] = to_floats(four_at(at_[axis], places) - at_[axis][a]);
    return offsets;
  }

 private:
  struct Node {
    std::int32_t split = 0;  ///< samples before the middle are not above it, the others not below
    int axis = 0;
  };
  struct Query;
  static constexpr std::size_t kMostInLeaf = 13;

  /// A node or, below all nodes, a block.
  struct Below {
    std::size_t node = 0;
    int depth = 0;
    [[nodiscard]] Below lower() const { return {2 * node + 1, depth + 1}; }
    [[nodiscard]] Below upper() const { return {2 * node + 2, depth + 1}; }
  };
  /// What is put in order below a node: places [begin, end).
  struct Range {
    std::size_t begin = 0, end = 0;
    [[nodiscard]] std::size_t middle() const { return begin + (end - begin) / 2; }
  };

  [[nodiscard]] const Block& block_at(const Below& below) const { return blocks_[below.node - nodes_.size()]; }
  void build(std::span<TreeItem> items, const Range& range, const Below& below);
  void build_block(std::span<TreeItem> items, const Range& range, Block& block);
  void search(Query& q, const Below& below, float squared) const;

  /// `outside`: by axis, how far below a node all lies outside of the box.
  template <class Visit>
  void for_blocks(const Around& around, const std::array<float, 3>& outside, const Visit& visit,
                  const Below& below) const {
    if (below.depth == depth_) {
      visit(block_at(below));
      return;
    }
    const Node& n = nodes_[below.node];
    const auto axis = static_cast<std::size_t>(n.axis);
    const auto go = [&](std::int32_t past, const Below& half) {
      std::array<float, 3> d = outside;
      d[axis] = std::max(d[axis], static_cast<float>(past));
      if (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] <= around.squared) for_blocks(around, d, visit, half);
    };
    go(around.box.low[axis] - n.split, below.lower());
    go(n.split - around.box.high[axis], below.upper());
  }

  /// By place, and kSpare more.
  std::array<std::vector<std::int32_t>, 3> at_;
  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;  ///< a heap: the children of i are 2 i + 1 and 2 i + 2
  std::vector<Block> blocks_;
  int depth_ = 0;  ///< of all blocks
};

}  // namespace lamina

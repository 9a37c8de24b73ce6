// The nearest samples around a sample: a balanced kd-tree over the fixed-point positions of a window. Its own tree
// beside edit/point_tree.h, which asks for the one nearest of any positions: here every sample asks for its k nearest,
// so leaves hold a dozen samples side by side and distances are sums of floats.
#pragma once
#include <algorithm>
#include <array>
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

  /// Wants three arrays of one length below 2^32, coordinates within +-(2^30 - 1).
  SampleTree(std::span<const std::int32_t> x, std::span<const std::int32_t> y, std::span<const std::int32_t> z);

  [[nodiscard]] std::size_t size() const { return order_.size(); }
  /// Number, in the arrays given, of the sample at each place.
  [[nodiscard]] const std::vector<std::uint32_t>& order() const { return order_; }

  /// The `k` (at most kMostNeighbours) nearest samples to the one at `place`, itself left out, that are not farther
  /// than the squared distance `bound`; nearest first, equally near ones by place. Returns how many there are.
  std::size_t nearest(std::uint32_t place, std::size_t k, float bound, Neighbour* found) const;

  /// Calls visit(neighbour, offset) for every sample within the squared distance but the one at `place`, in the order
  /// of places; `offset` is that of offset().
  template <class Visit>
  void within(std::uint32_t place, float squared, const Visit& visit) const {
    if (!order_.empty()) within(place, squared, visit, whole());
  }

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
    if (!order_.empty()) fours_within(shell, position(shell.place), visit, whole());
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

  /// Places [begin, end), which lie close together, and the box around them.
  struct Block {
    std::uint32_t begin = 0, end = 0;
    ItemBox box{};
  };
  static constexpr std::size_t kMostInLeaf = 26;
  /// A few leaves side by side, that of the place among them.
  [[nodiscard]] Block block_of(std::uint32_t place) const;
  /// Calls visit(leaf) for every leaf, a Block, that may hold samples within the squared distance of a box, in the
  /// order of places.
  template <class Visit>
  void around(const ItemBox& box, float squared, const Visit& visit) const {
    if (!order_.empty()) around({&box, squared, {}}, visit, whole());
  }

  [[nodiscard]] std::array<std::int32_t, 3> position(std::uint32_t place) const {
    return {at_[0][place], at_[1][place], at_[2][place]};
  }
  /// From the sample at place `a` to that at place `b`, steps.
  [[nodiscard]] std::array<float, 3> offset(std::uint32_t a, std::uint32_t b) const {
    return {static_cast<float>(at_[0][b] - at_[0][a]), static_cast<float>(at_[1][b] - at_[1][a]),
            static_cast<float>(at_[2][b] - at_[2][a])};
  }
  [[nodiscard]] const std::vector<std::int32_t>& axis(int a) const { return at_[static_cast<std::size_t>(a)]; }
  [[nodiscard]] PlacedAxes axes() const { return {at_[0].data(), at_[1].data(), at_[2].data()}; }

 private:
  struct Node {
    std::int32_t split = 0;  ///< samples before the middle are not above it, the others not below
    int axis = 0;
  };
  struct Query;

  /// What lies below a node: places [begin, end).
  struct Subtree {
    std::size_t node = 0, begin = 0, end = 0;
    int depth = 0;
    [[nodiscard]] std::size_t middle() const { return begin + (end - begin) / 2; }
    [[nodiscard]] Subtree lower() const { return {2 * node + 1, begin, middle(), depth + 1}; }
    [[nodiscard]] Subtree upper() const { return {2 * node + 2, middle(), end, depth + 1}; }
  };
  [[nodiscard]] Subtree whole() const { return {0, 0, order_.size(), 0}; }

  void build(std::span<TreeItem> items, const Subtree& tree);
  void search(Query& q, const Subtree& tree, float squared) const;

  template <class Visit>
  void fours_within(const Shell& shell, const std::array<std::int32_t, 3>& at, const Visit& visit,
                    const Subtree& tree) const {
    if (tree.depth == depth_) {
      const ItemBox& box = boxes_[tree.node - nodes_.size()];
      if (box.squared_to(at) <= shell.outer && box.farthest_squared_to(at) > shell.inner)
        fours_of(at, tree.begin, tree.end, visit);
      return;
    }
    const Node& n = nodes_[tree.node];
    const auto side = static_cast<float>(at[static_cast<std::size_t>(n.axis)] - n.split);
    if (side <= 0 || side * side <= shell.outer) fours_within(shell, at, visit, tree.lower());
    if (side >= 0 || side * side <= shell.outer) fours_within(shell, at, visit, tree.upper());
  }

  /// A box, how far around it, and by axis how far the node in question lies outside of it.
  struct Around {
    const ItemBox* box;
    float squared;
    std::array<float, 3> outside;
  };
  template <class Visit>
  void around(const Around& here, const Visit& visit, const Subtree& tree) const {
    if (tree.depth == depth_) {
      const ItemBox& box = boxes_[tree.node - nodes_.size()];
      if (box.squared_to(*here.box) <= here.squared)
        visit(Block{static_cast<std::uint32_t>(tree.begin), static_cast<std::uint32_t>(tree.end), box});
      return;
    }
    const Node& n = nodes_[tree.node];
    const auto axis = static_cast<std::size_t>(n.axis);
    const auto go = [&](std::int32_t past, const Subtree& half) {
      Around there = here;
      there.outside[axis] = std::max(there.outside[axis], static_cast<float>(past));
      const auto& d = there.outside;
      if (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] <= there.squared) around(there, visit, half);
    };
    go(here.box->low[axis] - n.split, tree.lower());
    go(n.split - here.box->high[axis], tree.upper());
  }

  template <class Visit>
  void within(std::uint32_t place, float squared, const Visit& visit, const Subtree& tree) const {
    if (tree.depth == depth_) {
      // Distances of the whole leaf first: several at once.
      const std::size_t n = tree.end - tree.begin;
      std::array<std::array<float, kMostInLeaf>, 3> d;
      std::array<float, kMostInLeaf> d2;
      for (std::size_t a = 0; a < 3; ++a) {
        const std::int32_t* const at = at_[a].data() + tree.begin;
        const std::int32_t from = at_[a][place];
        for (std::size_t i = 0; i < n; ++i) d[a][i] = static_cast<float>(at[i] - from);
      }
      for (std::size_t i = 0; i < n; ++i) d2[i] = d[0][i] * d[0][i] + d[1][i] * d[1][i] + d[2][i] * d[2][i];
      for (std::size_t i = 0; i < n; ++i) {
        if (d2[i] > squared || tree.begin + i == place) continue;
        visit(Neighbour{d2[i], static_cast<std::uint32_t>(tree.begin + i)},
              std::array<float, 3>{d[0][i], d[1][i], d[2][i]});
      }
      return;
    }
    const Node& n = nodes_[tree.node];
    const auto side = static_cast<float>(at_[static_cast<std::size_t>(n.axis)][place] - n.split);
    if (side <= 0 || side * side <= squared) within(place, squared, visit, tree.lower());
    if (side >= 0 || side * side <= squared) within(place, squared, visit, tree.upper());
  }

  /// By place; behind the last one there are some more numbers, so that four can be loaded from anywhere.
  std::array<std::vector<std::int32_t>, 3> at_;
  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;     ///< a heap: the children of i are 2 i + 1 and 2 i + 2; all leaves are at one depth
  std::vector<ItemBox> boxes_;  ///< of the leaves
  int depth_ = 0;
};

}  // namespace lamina

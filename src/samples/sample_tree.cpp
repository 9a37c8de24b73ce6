#include "samples/sample_tree.h"

#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

namespace lamina {
namespace {

constexpr std::size_t kLeaf = 12;            ///< samples a leaf has at most
constexpr std::size_t kParallel = 1u << 14;  ///< smaller ranges are built by one thread

typedef std::int32_t FourInts __attribute__((vector_size(16)));  // NOLINT(modernize-use-using): attributes on typedefs

}  // namespace

struct SampleTree::Query {
  std::array<std::int32_t, 3> at;
  std::uint32_t place = 0;
  std::size_t wanted = 0, count = 0;
  float bound = 0;  ///< farther samples are of no interest
  Neighbour* found = nullptr;
  std::array<float, 3> outside{};  ///< by axis: how far the node in question lies from the sample

  void take(Neighbour n) {
    if (count == wanted) {
      if (!(n < found[count - 1])) return;
    } else {
      ++count;
    }
    std::size_t i = count - 1;
    for (; i > 0 && n < found[i - 1]; --i) found[i] = found[i - 1];
    found[i] = n;
    if (count == wanted) bound = found[count - 1].squared;
  }
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

/// Brings the item that sorting along an axis would put at `nth` there, and the smaller ones before it. Where
/// coordinates are as good as random every second branch of std::nth_element is guessed wrong; this partition has none.
class SampleTree::Median {
 public:
  Median(std::vector<Item>& items, std::size_t axis) : items_(items), axis_(axis) {}

  void select(std::size_t begin, std::size_t nth, std::size_t end) {
    constexpr std::size_t kFew = 24;
    constexpr int kMostRounds = 64;  // far more than any but made-up coordinates take
    for (int round = 0; end - begin > kFew && round < kMostRounds; ++round) {
      const std::size_t middle = partition(begin, end);
      if (nth < middle) {
        end = middle;
      } else if (nth > middle) {
        begin = middle + 1;
      } else {
        return;
      }
    }
    std::nth_element(at(begin), at(nth), at(end), [this](const Item& a, const Item& b) { return key(a) < key(b); });
  }

 private:
  /// Distinct, in the order of coordinates.
  [[nodiscard]] std::int64_t key(const Item& item) const {
    return std::int64_t{item.at[axis_]} * kNumbers + item.number;
  }
  [[nodiscard]] std::vector<Item>::iterator at(std::size_t i) const {
    return items_.begin() + static_cast<std::ptrdiff_t>(i);
  }
  /// About an item from near the middle; returns its place.
  std::size_t partition(std::size_t begin, std::size_t end) {
    const std::size_t last = end - 1;
    std::swap(items_[ninther(begin, end)], items_[last]);
    const std::int64_t pivot = key(items_[last]);
    std::size_t middle = begin;
    for (std::size_t i = begin; i < last; ++i) {
      const Item item = items_[i];
      items_[i] = items_[middle];
      items_[middle] = item;
      middle += key(item) < pivot ? 1 : 0;
    }
    std::swap(items_[middle], items_[last]);
    return middle;
  }
  [[nodiscard]] std::size_t ninther(std::size_t begin, std::size_t end) const {
    const std::size_t step = (end - begin) / 9;
    const auto of_three = [this](std::size_t a, std::size_t b, std::size_t c) {
      if (key(items_[a]) > key(items_[b])) std::swap(a, b);
      if (key(items_[b]) > key(items_[c])) b = key(items_[a]) > key(items_[c]) ? a : c;
      return b;
    };
    const auto triple = [&](std::size_t first) { return of_three(first, first + step, first + 2 * step); };
    return of_three(triple(begin), triple(begin + 3 * step), triple(begin + 6 * step));
  }

  static constexpr std::int64_t kNumbers = std::int64_t{1} << 32;
  std::vector<Item>& items_;
  std::size_t axis_;
};

void SampleTree::assign(std::span<const std::int32_t> x, std::span<const std::int32_t> y,
                        std::span<const std::int32_t> z) {
  const std::size_t n = x.size();
  items_.resize(n);
  for (std::size_t i = 0; i < n; ++i) items_[i] = {{x[i], y[i], z[i]}, static_cast<std::uint32_t>(i)};
  depth_ = 0;
  while ((n >> depth_) > kLeaf) ++depth_;
  nodes_.resize((std::size_t{1} << depth_) - 1);
  if (n > 0) build({0, 0, n, 0});
  order_.resize(n);
  for (auto& axis : at_) axis.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    order_[i] = items_[i].number;
    for (std::size_t a = 0; a < 3; ++a) at_[a][i] = items_[i].at[a];
  }
}

void SampleTree::build(const Subtree& tree) {
  if (tree.depth == depth_) return;
  // All three axes at once; the number goes along.
  static_assert(sizeof(Item) == sizeof(FourInts));
  const auto item = [this](std::size_t i) {
    FourInts four;
    std::memcpy(&four, &items_[i], sizeof(four));
    return four;
  };
  FourInts low = item(tree.begin);
  FourInts high = low;
  for (std::size_t i = tree.begin + 1; i < tree.end; ++i) {
    const FourInts at = item(i);
    low = at < low ? at : low;
    high = at > high ? at : high;
  }
  std::size_t axis = 0;
  const FourInts extent = high - low;
  for (std::size_t a = 1; a < 3; ++a) {
    if (extent[a] > extent[axis]) axis = a;
  }
  Median(items_, axis).select(tree.begin, tree.middle(), tree.end);
  nodes_[tree.node] = {items_[tree.middle()].at[axis], static_cast<int>(axis)};
  if (tree.end - tree.begin > kParallel) {
    tbb::parallel_invoke([&] { build(tree.lower()); }, [&] { build(tree.upper()); });
  } else {
    build(tree.lower());
    build(tree.upper());
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
    std::array<float, kMostInLeaf> d2;
    const std::size_t begin = tree.begin;
    const std::size_t n = tree.end - begin;
    const std::int32_t* x = at_[0].data() + begin;
    const std::int32_t* y = at_[1].data() + begin;
    const std::int32_t* z = at_[2].data() + begin;
    for (std::size_t i = 0; i < n; ++i) {
      const auto dx = static_cast<float>(x[i] - q.at[0]);
      const auto dy = static_cast<float>(y[i] - q.at[1]);
      const auto dz = static_cast<float>(z[i] - q.at[2]);
      d2[i] = dx * dx + dy * dy + dz * dz;
    }
    for (std::size_t i = 0; i < n; ++i) {
      if (d2[i] <= q.bound && begin + i != q.place) q.take({d2[i], static_cast<std::uint32_t>(begin + i)});
    }
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

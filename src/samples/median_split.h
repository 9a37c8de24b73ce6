// Halving samples along an axis, for trees over their positions.
#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <utility>

#include "base/four.h"

namespace lamina {

/// A sample in a tree that is being built.
struct TreeItem {
  std::array<std::int32_t, 3> at;
  std::uint32_t number;
};

/// A box of samples, all three axes at once; the fourth lane is anything.
struct ItemBox {
  FourInts low, high;

  /// Around one sample or more.
  static ItemBox around(std::span<const TreeItem> items) {
    static_assert(sizeof(TreeItem) == sizeof(FourInts));
    const auto item = [&](std::size_t i) {
      FourInts four;
      std::memcpy(&four, &items[i], sizeof(four));
      return four;
    };
    ItemBox box{item(0), item(0)};
    for (std::size_t i = 1; i < items.size(); ++i) {
      const FourInts at = item(i);
      box.low = at < box.low ? at : box.low;
      box.high = at > box.high ? at : box.high;
    }
    return box;
  }
  /// To another box, 0 where they touch; steps^2. No sample of one box is nearer to one of the other, rounding
  /// included.
  [[nodiscard]] float squared_to(const ItemBox& other) const {
    const FourInts below = low - other.high;
    const FourInts above = other.low - high;
    FourInts past = below > above ? below : above;
    past = past > 0 ? past : FourInts{};
    const FourFloats d = to_floats(past);
    return d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
  }
  static ItemBox of(const std::array<std::int32_t, 3>& at) {
    const FourInts four{at[0], at[1], at[2], 0};
    return {four, four};
  }
  [[nodiscard]] ItemBox with(const ItemBox& other) const {
    return {low < other.low ? low : other.low, high > other.high ? high : other.high};
  }
  [[nodiscard]] std::size_t longest_axis() const {
    const FourInts extent = high - low;
    std::size_t axis = 0;
    for (std::size_t a = 1; a < 3; ++a) {
      if (extent[a] > extent[axis]) axis = a;
    }
    return axis;
  }
};

/// Brings the item that sorting along an axis would put at `nth` there, and the smaller ones before it. Where
/// coordinates are as good as random every second branch of std::nth_element is guessed wrong; this partition has none.
class MedianSplit {
 public:
  MedianSplit(std::span<TreeItem> items, std::size_t axis) : items_(items), axis_(axis) {}

  void select(std::size_t begin, std::size_t nth, std::size_t end) {
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
    select_of_few(begin, nth, end);
  }

 private:
  /// Distinct, in the order of coordinates.
  [[nodiscard]] std::int64_t key(const TreeItem& item) const {
    return std::int64_t{item.at[axis_]} * kNumbers + item.number;
  }
  [[nodiscard]] bool less(std::size_t a, std::size_t b) const { return key(items_[a]) < key(items_[b]); }

  /// Leaves the items in the order in which the GNU library's std::nth_element does (its partition by the median of
  /// three, Hoare's way): trees are to stay what they are. But that guesses a branch for every item, and this none:
  /// first each item says by a bit on which side it belongs, then those that are on the wrong one change places.
  void select_of_few(std::size_t begin, std::size_t nth, std::size_t end) {
    const auto all = items_.subspan(begin, end - begin);
    if (all.size() > kFew || nth == end) return by_library(begin, nth, end);
    std::array<TreeItem, kFew> before;
    std::copy(all.begin(), all.end(), before.begin());
    const std::size_t first = begin, last = end;
    // After so many rounds the library turns to another way: for orders that are made up.
    int left = 2 * (static_cast<int>(std::bit_width(all.size())) - 1);
    while (end - begin > 3) {
      if (left-- == 0) {
        std::copy_n(before.begin(), all.size(), all.begin());
        return by_library(first, nth, last);
      }
      const std::size_t cut = partition_of_few(begin, end);
      if (cut <= nth) {
        begin = cut;
      } else {
        end = cut;
      }
    }
    sort_three(begin, end);
  }
  void by_library(std::size_t begin, std::size_t nth, std::size_t end) {
    std::nth_element(at(begin), at(nth), at(end),
                     [this](const TreeItem& a, const TreeItem& b) { return key(a) < key(b); });
  }
  [[nodiscard]] std::span<TreeItem>::iterator at(std::size_t i) const {
    return items_.begin() + static_cast<std::ptrdiff_t>(i);
  }
  /// About an item from near the middle; returns its place.
  std::size_t partition(std::size_t begin, std::size_t end) {
    const std::size_t last = end - 1;
    std::swap(items_[ninther(begin, end)], items_[last]);
    const std::int64_t pivot = key(items_[last]);
    std::size_t middle = begin;
    for (std::size_t i = begin; i < last; ++i) {
      const TreeItem item = items_[i];
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

  /// About the median of the second, the middle and the last one; returns where those above it begin.
  std::size_t partition_of_few(std::size_t begin, std::size_t end) {
    const std::size_t a = begin + 1, b = begin + (end - begin) / 2, c = end - 1;
    const bool ab = less(a, b), bc = less(b, c), ac = less(a, c);
    // Where all three compare one way round, the middle one is b; else a or c.
    const std::size_t median = ab == bc ? b : (ab == ac ? c : a);
    std::swap(items_[begin], items_[median]);
    const std::int64_t pivot = key(items_[begin]);
    std::uint32_t below = 0;
    for (std::size_t i = a; i < end; ++i) below |= static_cast<std::uint32_t>(key(items_[i]) < pivot) << (i - a);
    const int count = std::popcount(below);
    const std::uint32_t front = (std::uint32_t{1} << count) - 1;
    std::uint32_t wrong_front = ~below & front;
    for (std::uint32_t wrong_back = below & ~front; wrong_back != 0;) {
      const auto back = static_cast<std::size_t>(std::bit_width(wrong_back) - 1);
      std::swap(items_[a + static_cast<std::size_t>(std::countr_zero(wrong_front))], items_[a + back]);
      wrong_front &= wrong_front - 1;
      wrong_back ^= std::uint32_t{1} << back;
    }
    return a + static_cast<std::size_t>(count);
  }
  /// Three or fewer, as they compare: a place is the number of those below.
  void sort_three(std::size_t begin, std::size_t end) {
    const std::size_t n = end - begin;
    std::array<TreeItem, 3> sorted;
    for (std::size_t i = 0; i < n; ++i) {
      std::size_t place = 0;
      for (std::size_t k = 0; k < n; ++k) place += static_cast<std::size_t>(less(begin + k, begin + i));
      sorted[place] = items_[begin + i];
    }
    std::copy_n(sorted.begin(), n, at(begin));
  }

  static constexpr std::size_t kFew = 24;
  static constexpr std::int64_t kNumbers = std::int64_t{1} << 32;
  std::span<TreeItem> items_;
  std::size_t axis_;
};

}  // namespace lamina

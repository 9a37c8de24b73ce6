// The nearest of the samples looked at so far, in a search through a tree.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

namespace lamina {

struct Neighbour {
  float squared = 0;         ///< distance, steps^2
  std::uint32_t sample = 0;  ///< place in the tree's order
  friend bool operator<(const Neighbour& a, const Neighbour& b) {
    return a.squared < b.squared || (a.squared == b.squared && a.sample < b.sample);
  }
};

/// Positions by place of a tree.
struct PlacedAxes {
  const std::int32_t* x = nullptr;
  const std::int32_t* y = nullptr;
  const std::int32_t* z = nullptr;
};

/// Of the `count` samples from `begin` on to a position, in steps^2.
inline void squared_distances(const PlacedAxes& from, std::size_t begin, std::size_t count,
                              const std::array<std::int32_t, 3>& at, float* squared) {
  const std::int32_t* const x = from.x + begin;
  const std::int32_t* const y = from.y + begin;
  const std::int32_t* const z = from.z + begin;
  for (std::size_t i = 0; i < count; ++i) {
    const auto dx = static_cast<float>(x[i] - at[0]);
    const auto dy = static_cast<float>(y[i] - at[1]);
    const auto dz = static_cast<float>(z[i] - at[2]);
    squared[i] = dx * dx + dy * dy + dz * dz;
  }
}

/// Those of one sample, nearest first, equally near ones by place.
struct NearestList {
  std::array<std::int32_t, 3> at{};
  std::uint32_t place = 0;  ///< of the sample itself, which is left out
  std::size_t wanted = 0, count = 0;
  float bound = 0;             ///< squared: farther samples are of no interest
  Neighbour* found = nullptr;  ///< room for `wanted`

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

  /// Of the samples at [begin, end), kMost at most.
  template <std::size_t kMost>
  void take_places(const PlacedAxes& from, std::size_t begin, std::size_t end) {
    std::array<float, kMost> d2;
    const std::size_t n = end - begin;
    squared_distances(from, begin, n, at, d2.data());
    for (std::size_t i = 0; i < n; ++i) {
      if (d2[i] <= bound && begin + i != place) take({d2[i], static_cast<std::uint32_t>(begin + i)});
    }
  }
};

}  // namespace lamina

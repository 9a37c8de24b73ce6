// The nearest of the samples looked at so far, in a search through a tree: any number of them (NearestList), or the
// sixteen nearest without a branch for each (NearestFew), what a search around many samples spends its time on.
#pragma once
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

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

/// Those of one sample, nearest first, equally near ones by place.
class NearestFew {
 public:
  static constexpr std::size_t kFew = 16;

  /// Of the sample at `place`, itself left out; farther ones than `bound` (squared) are of no interest.
  void start(const std::array<std::int32_t, 3>& at, std::uint32_t place, float bound) {
    at_ = at;
    place_ = place;
    none_ = key_of(bound, ~std::uint32_t{0});
    keys_.fill(none_);
    keys_[0] = 0;  // before all others
  }
  /// Squared distance from which on samples are of no interest.
  [[nodiscard]] float bound() const {
    return std::bit_cast<float>(static_cast<std::uint32_t>(std::bit_cast<std::uint64_t>(keys_.back()) >> 32));
  }
  /// The samples at [begin, end), kMost at most.
  template <std::size_t kMost>
  void take(const PlacedAxes& from, std::size_t begin, std::size_t end) {
    std::array<float, kMost> d2;
    const std::size_t n = end - begin;
    squared_distances(from, begin, n, at_, d2.data());
    const float bound = this->bound();
    std::array<double, kMost> near;
    std::size_t count = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const auto place = static_cast<std::uint32_t>(begin + i);
      near[count] = key_of(d2[i], place);
      count += static_cast<std::size_t>(d2[i] <= bound) & static_cast<std::size_t>(place != place_);
    }
    for (std::size_t i = 0; i < count; ++i) insert(near[i]);
  }
  /// Writes the first ones found and returns how many there are, kFew at most.
  std::size_t write(std::span<std::uint32_t> places) const {
    std::size_t n = 0;
    for (; n < places.size() && n < kFew && keys_[n + 1] < none_; ++n)
      places[n] = static_cast<std::uint32_t>(std::bit_cast<std::uint64_t>(keys_[n + 1]));
    return n;
  }

 private:
  typedef double Two __attribute__((vector_size(16)));  // NOLINT(modernize-use-using): attributes on typedefs

  /// Distance, then place: as the bits of numbers that compare like them. Distances are finite, so none is a NaN.
  static double key_of(float squared, std::uint32_t place) {
    return std::bit_cast<double>(std::uint64_t{std::bit_cast<std::uint32_t>(squared)} << 32 | place);
  }
  /// Every key becomes the middle one of itself, the one before and the new one: what lies behind the new one moves on.
  void insert(double key) {
    const Two added{key, key};
    for (std::size_t pair = kFew / 2; pair-- > 0;) {
      const std::size_t i = 2 * pair + 1;
      Two here, before;
      std::memcpy(&here, &keys_[i], sizeof(here));
      std::memcpy(&before, &keys_[i - 1], sizeof(before));
      const Two later = before > added ? before : added;
      here = here < later ? here : later;
      std::memcpy(&keys_[i], &here, sizeof(here));
    }
  }

  std::array<double, kFew + 1> keys_;
  double none_ = 0;
  std::array<std::int32_t, 3> at_{};
  std::uint32_t place_ = 0;
};

}  // namespace lamina

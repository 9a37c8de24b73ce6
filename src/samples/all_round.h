// Whether a sample's neighbours lie on all sides of it: those of one scan line do not, however many there are, nor do
// those at a rim.
#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>

namespace lamina {

/// Neighbours in a sample's tangent plane, from nearest to farthest until they leave no gap of 150 degrees.
class AllRound {
 public:
  /// A neighbour at (x, y) from the sample, any unit.
  void add(float x, float y) {
    constexpr float kPerRadian = kSectors / (2 * std::numbers::pi_v<float>);
    const auto turned = static_cast<std::size_t>((std::atan2(y, x) + std::numbers::pi_v<float>)*kPerRadian);
    float& nearest = nearest_[turned % kSectors];
    nearest = std::fmin(nearest, x * x + y * y);
  }

  /// How far away the neighbour is with which they lie on all sides; infinite where all of them do not.
  [[nodiscard]] float distance() const {
    // Of every gap that is too wide a neighbour has to be within reach.
    float farthest = 0;
    for (std::size_t first = 0; first < kSectors; ++first) {
      float nearest = std::numeric_limits<float>::infinity();
      for (std::size_t k = 0; k < kGap; ++k) nearest = std::fmin(nearest, nearest_[(first + k) % kSectors]);
      farthest = std::fmax(farthest, nearest);
    }
    return std::sqrt(farthest);
  }

 private:
  static constexpr std::size_t kSectors = 24;
  static constexpr std::size_t kGap = 10;  ///< sectors, 150 degrees
  std::array<float, kSectors> nearest_ = [] {
    std::array<float, kSectors> none{};
    none.fill(std::numeric_limits<float>::infinity());
    return none;
  }();
};

}  // namespace lamina

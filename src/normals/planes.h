// The plane that fits samples best, by principal component analysis in closed form.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/four.h"
#include "samples/nearest.h"
#include "samples/sample_tree.h"

namespace lamina::normals {

/// Sums of offsets from one sample, of any unit: where it is among its neighbours they cannot cancel.
struct Moments {
  double count = 0;  ///< or weight
  std::array<double, 3> sum{};
  std::array<double, 6> products{};  ///< xx xy xz yy yz zz

  void add(const std::array<float, 3>& d, double weight = 1) {
    const double x = d[0];
    const double y = d[1];
    const double z = d[2];
    count += weight;
    sum[0] += weight * x;
    sum[1] += weight * y;
    sum[2] += weight * z;
    products[0] += weight * x * x;
    products[1] += weight * x * y;
    products[2] += weight * x * z;
    products[3] += weight * y * y;
    products[4] += weight * y * z;
    products[5] += weight * z * z;
  }
};

/// Over the sample at `place` and others, nearest first.
Moments moments_around(const SampleTree& tree, std::uint32_t place, std::span<const Neighbour> others);

struct Plane {
  std::array<float, 3> normal{};           ///< unit length; zero where there is none: samples on a line or a point
  double least = 0, middle = 0, most = 0;  ///< variance along the principal axes

  [[nodiscard]] bool valid() const { return normal[0] != 0 || normal[1] != 0 || normal[2] != 0; }
};

/// Two at a time: what takes long is the waiting of one division for the one before. Only sums, products, quotients and
/// square roots: the same bits on every processor. The sign of the normal means nothing.
std::array<Plane, 2> fit_planes(const std::array<Moments, 2>& moments);
inline Plane fit_plane(const Moments& moments) {
  return fit_planes({moments, moments})[0];
}

/// Moments of four samples at a time, in floats: what they lose is a millionth of the largest variance, and so is a
/// direction's error.
struct FourMoments {
  FourFloats count{};
  std::array<FourFloats, 3> sum{};
  std::array<FourFloats, 6> products{};

  void add(const std::array<FourFloats, 3>& d, const FourFloats& weight);
  [[nodiscard]] Moments total() const;
};

/// Sums over the samples around one of them, itself among them, as far as is asked for.
class BallMoments {
 public:
  BallMoments(const SampleTree& tree, std::uint32_t place) : tree_(tree), place_(place) {}
  /// Within a squared distance (steps^2) that is never less than the one before.
  Moments grow_to(float squared);

 private:
  const SampleTree& tree_;
  std::uint32_t place_;
  float squared_ = -1;  ///< so far
  FourMoments sums_;
};

/// The plane of the samples within a squared distance; they count the less the farther away they are. Not valid where
/// there is none.
Plane plane_within(const SampleTree& tree, std::uint32_t place, float squared);

}  // namespace lamina::normals

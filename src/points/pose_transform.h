// Points moved into a pose.
#pragma once
#include <array>
#include <cstddef>
#include <string>

#include "lamina/points.h"

namespace lamina {

class PoseTransform {
 public:
  /// Throws Error(unreadable), beginning with `name`, for a pose that is singular, not affine or not finite.
  PoseTransform(const Pose& pose, const std::string& name);
  /// Moves rows [begin, end) of the batch.
  void apply(SampleBatch& batch, std::size_t begin, std::size_t end) const;
  /// A point, or a direction, which stays where it is.
  [[nodiscard]] std::array<double, 3> moved(const std::array<double, 3>& p, bool direction) const;

 private:
  Pose pose_;
  double normal_[3][3] = {};
  double radius_ = 1;
};

}  // namespace lamina

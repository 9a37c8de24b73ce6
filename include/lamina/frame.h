// The frame a run computes in: origin, rotation to the sweep axis, and the fixed-point step (METHOD 3.1).
#pragma once
#include <Eigen/Core>
#include <cmath>
#include <cstdint>

namespace lamina {

enum class FrameMode {
  pca,   ///< sweep along the dominant axis of the covariance: smallest cross-section, least memory
  axis,  ///< sweep along the input's longest axis: the lattice stays aligned with the input's axes
};

/// local = rotation * (world - origin) / step, rounded to integers; axis 2 (z) is the sweep axis.
struct Frame {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();        ///< input coordinates, centre of the cloud's bounding box
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< rows are the local axes in input coordinates
  double step = 1;                                         ///< input units per fixed-point step (a power of two)

  [[nodiscard]] Eigen::Vector3d to_local(const Eigen::Vector3d& world) const {
    return rotation * (world - origin) / step;
  }
  [[nodiscard]] Eigen::Vector3d to_world(const Eigen::Vector3d& local) const {
    return rotation.transpose() * (local * step) + origin;
  }
};

}  // namespace lamina

// The frame that a run computes in: origin, rotation to the sweep axis and fixed-point step (Cuccuru et al. 2009,
// section 3.1).
#pragma once
#include <Eigen/Core>
#include <cmath>
#include <cstdint>

namespace lamina {

/// The sweep axis.
enum class FrameMode {
  pca,   ///< sweep along the dominant axis of the covariance: smallest cross-section, least memory
  axis,  ///< sweep along the input's longest axis: the lattice stays aligned with the input's axes
};

/// local = rotation * (world - origin) / step, rounded to integers. Axis 2 (z) of the frame is the sweep axis.
struct Frame {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();        ///< input coordinates, centre of the cloud's bounding box
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< rows are the local axes in input coordinates
  double step = 1;                                         ///< input units per fixed-point step (a power of two)

  /// From input coordinates to steps, not rounded.
  [[nodiscard]] Eigen::Vector3d to_local(const Eigen::Vector3d& world) const {
    return rotation * (world - origin) / step;
  }
  /// From steps to input coordinates.
  [[nodiscard]] Eigen::Vector3d to_world(const Eigen::Vector3d& local) const {
    return rotation.transpose() * (local * step) + origin;
  }
};

}  // namespace lamina

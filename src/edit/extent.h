// Where a cloud lies, in one pass over it.
#pragma once
#include <Eigen/Core>
#include <cstdint>

#include "lamina/points.h"
#include "lamina/run.h"

namespace lamina::edit {

/// Of the rows with finite positions; without any, count is 0 and the box is empty.
struct Extent {
  std::uint64_t count = 0;
  Eigen::Vector3d low, high;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

/// Sums are made of batches in order, about the first point: the same bits for any number of threads, and no
/// cancellation far from the origin.
Extent find_extent(PointSource& source, const RunContext& run);

/// Unit vector of the greatest spread, its largest component positive.
Eigen::Vector3d dominant_axis(const Extent& extent);

}  // namespace lamina::edit

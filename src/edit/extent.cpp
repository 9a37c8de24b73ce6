#include "edit/extent.h"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>

#include "edit/batch_pipe.h"

namespace lamina::edit {

Extent find_extent(PointSource& source, const RunContext& run) {
  Extent e;
  e.low.setConstant(std::numeric_limits<double>::infinity());
  e.high = -e.low;
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero(), sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  for_each_batch(
      source, "survey", run, [](SampleBatch&) {},
      [&](const SampleBatch& b) {
        for (std::size_t i = 0; i < b.size(); ++i) {
          const Eigen::Vector3d p(b.x[i], b.y[i], b.z[i]);
          if (!p.allFinite()) continue;
          if (e.count++ == 0) pivot = p;
          e.low = e.low.cwiseMin(p);
          e.high = e.high.cwiseMax(p);
          const Eigen::Vector3d d = p - pivot;
          sum += d;
          products += d * d.transpose();
        }
      });
  if (e.count == 0) return e;
  const auto n = static_cast<double>(e.count);
  e.covariance = products / n - (sum / n) * (sum / n).transpose();
  return e;
}

Eigen::Vector3d dominant_axis(const Extent& extent) {
  if (!extent.covariance.allFinite()) return Eigen::Vector3d::UnitZ();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(extent.covariance);
  Eigen::Vector3d axis = solver.eigenvectors().col(2);
  int largest = 0;
  axis.cwiseAbs().maxCoeff(&largest);
  return axis[largest] < 0 ? Eigen::Vector3d(-axis) : axis;
}

}  // namespace lamina::edit

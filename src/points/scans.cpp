#include "points/scans.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "lamina/error.h"

namespace lamina {
namespace {

class OneGrid final : public PointSource, public OrganisedPoints {
 public:
  OneGrid(std::unique_ptr<PointSource> source, std::shared_ptr<const ScanGrid> grid)
      : source_(std::move(source)), grid_(std::move(grid)) {
    info_ = source_->info();
  }
  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override { source_->read(first, count, out); }
  [[nodiscard]] std::vector<PlacedGrid> grids() const override { return {{0, grid_}}; }

 private:
  std::unique_ptr<PointSource> source_;
  std::shared_ptr<const ScanGrid> grid_;
};

class PosedPoints final : public PointSource, public OrganisedPoints {
 public:
  PosedPoints(std::unique_ptr<PointSource> source, const Pose& pose, bool seen_along_z)
      : source_(std::move(source)), transform_(pose, source_->info().path) {
    info_ = source_->info();
    info_.double_precision = true;
    info_.crs.clear();  // it is the system of the source's own coordinates
    if (info_.scans.empty()) info_.scans.resize(1);
    for (ScanPart& scan : info_.scans) {
      if (scan.scanner == ScanPart::Scanner::unknown) {
        scan.scanner = seen_along_z ? ScanPart::Scanner::direction : ScanPart::Scanner::pose_origin;
        scan.at = {0, 0, seen_along_z ? 1.0 : 0.0};
      }
      scan.at = transform_.moved(scan.at, scan.scanner == ScanPart::Scanner::direction);
    }
  }

  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    source_->read(first, count, out);
    transform_.apply(out, 0, out.size());
  }

  [[nodiscard]] std::vector<PlacedGrid> grids() const override { return grids_of(*source_); }

 private:
  std::unique_ptr<PointSource> source_;
  PoseTransform transform_;
};

}  // namespace

void ScanGrid::add(bool filled) {
  filled_.push_back(filled);
  if (filled) ++rows_;
}

std::unique_ptr<PointSource> organised_points(std::unique_ptr<PointSource> source,
                                              std::shared_ptr<const ScanGrid> grid) {
  return std::make_unique<OneGrid>(std::move(source), std::move(grid));
}

std::vector<PlacedGrid> grids_of(const PointSource& source) {
  const auto* organised = dynamic_cast<const OrganisedPoints*>(&source);
  return organised != nullptr ? organised->grids() : std::vector<PlacedGrid>{};
}

PoseTransform::PoseTransform(const Pose& pose, const std::string& name) : pose_(pose) {
  const auto refuse = [&](const char* what) {
    throw Error(
        ExitCode::unreadable,
        fmt::format("{}: {}; a pose is 16 numbers, row by row: rotation and translation, and 0 0 0 1", name, what));
  };
  for (const auto& row : pose) {
    if (!std::all_of(row.begin(), row.end(), [](double v) { return std::isfinite(v); }))
      refuse("the pose is not finite");
  }
  constexpr double kTolerance = 1e-9;
  for (std::size_t c = 0; c < 4; ++c) {
    if (std::abs(pose[3][c] - (c == 3 ? 1 : 0)) > kTolerance) refuse("the pose's last row is not 0 0 0 1");
  }
  Eigen::Matrix3d linear;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) linear(r, c) = pose[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)];
  }
  const double largest = linear.cwiseAbs().maxCoeff();
  const double volume = linear.determinant();
  if (!(std::abs(volume) > 1e-9 * largest * largest * largest)) refuse("the pose is singular");
  const Eigen::Matrix3d normal = linear.inverse().transpose() * std::cbrt(std::abs(volume));
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) normal_[r][c] = normal(r, c);
  }
  radius_ = std::cbrt(std::abs(volume));
}

std::array<double, 3> PoseTransform::moved(const std::array<double, 3>& p, bool direction) const {
  std::array<double, 3> q{};
  for (std::size_t r = 0; r < 3; ++r)
    q[r] = pose_[r][0] * p[0] + pose_[r][1] * p[1] + pose_[r][2] * p[2] + (direction ? 0 : pose_[r][3]);
  return q;
}

void PoseTransform::apply(SampleBatch& batch, std::size_t begin, std::size_t end) const {
  for (std::size_t i = begin; i < end; ++i) {
    const double x = batch.x[i];
    const double y = batch.y[i];
    const double z = batch.z[i];
    batch.x[i] = pose_[0][0] * x + pose_[0][1] * y + pose_[0][2] * z + pose_[0][3];
    batch.y[i] = pose_[1][0] * x + pose_[1][1] * y + pose_[1][2] * z + pose_[1][3];
    batch.z[i] = pose_[2][0] * x + pose_[2][1] * y + pose_[2][2] * z + pose_[2][3];
  }
  for (std::size_t i = begin; i < end && !batch.nx.empty(); ++i) {
    const double x = batch.nx[i];
    const double y = batch.ny[i];
    const double z = batch.nz[i];
    batch.nx[i] = static_cast<float>(normal_[0][0] * x + normal_[0][1] * y + normal_[0][2] * z);
    batch.ny[i] = static_cast<float>(normal_[1][0] * x + normal_[1][1] * y + normal_[1][2] * z);
    batch.nz[i] = static_cast<float>(normal_[2][0] * x + normal_[2][1] * y + normal_[2][2] * z);
  }
  for (std::size_t i = begin; i < end && !batch.radius.empty(); ++i) {
    batch.radius[i] = static_cast<float>(batch.radius[i] * radius_);
  }
}

std::unique_ptr<PointSource> pose_points(std::unique_ptr<PointSource> source, const Pose& pose, bool seen_along_z) {
  return std::make_unique<PosedPoints>(std::move(source), pose, seen_along_z);
}

}  // namespace lamina

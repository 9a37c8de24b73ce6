#include "lamina/align.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <numbers>
#include <random>
#include <type_traits>
#include <utility>
#include <vector>

namespace lamina {
namespace {

/// Points of a bumpy ball of radius about 1, each of one of several scans.
struct Scanned {
  SampleBatch points;
  std::vector<ScanPart> parts;  ///< where rows tell the scans
  AttributeLayout attributes;   ///< where an attribute does
};

class ScannedSource final : public PointSource {
 public:
  explicit ScannedSource(Scanned cloud) : cloud_(std::move(cloud)) {
    info_.path = "cloud";
    info_.count = cloud_.points.size();
    info_.has_normals = true;
    info_.scans = cloud_.parts;
    info_.attributes = cloud_.attributes;
  }
  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    const SampleBatch& p = cloud_.points;
    const auto begin = static_cast<std::ptrdiff_t>(std::min<std::uint64_t>(first, p.size()));
    const auto end = static_cast<std::ptrdiff_t>(std::min<std::uint64_t>(first + count, p.size()));
    const auto part = [&](const auto& values) {
      return std::decay_t<decltype(values)>(values.begin() + begin, values.begin() + end);
    };
    out = {};
    out.first = first;
    out.x = part(p.x), out.y = part(p.y), out.z = part(p.z);
    out.nx = part(p.nx), out.ny = part(p.ny), out.nz = part(p.nz);
    for (const auto& values : p.attributes) out.attributes.push_back(part(values));
  }

 private:
  Scanned cloud_;
};

struct Pose {
  std::array<double, 3> about{}, shift{};
};

constexpr double kBumps = 0.05;

double radius_towards(const Eigen::Vector3d& d) {
  return 1 + kBumps * std::sin(5 * d.x()) * std::sin(4 * d.y() + 1) * std::cos(3 * d.z());
}

/// Each scan sees the side towards one of four directions and a good deal around it, with noise along the normal.
Scanned scan(const std::vector<Pose>& poses, double noise, std::size_t samples_each) {
  Scanned out;
  std::mt19937 random(5);
  std::normal_distribution<> bell;
  for (std::size_t s = 0; s < poses.size(); ++s) {
    out.parts.push_back({out.points.size(), ScanPart::Scanner::unknown, {}});
    const double turn = 2 * std::numbers::pi * static_cast<double>(s) / static_cast<double>(poses.size());
    const Eigen::Vector3d towards(std::cos(turn), std::sin(turn), 0.3 * (s % 2 == 0 ? 1 : -1));
    for (std::size_t i = 0; i < samples_each;) {
      const Eigen::Vector3d d = Eigen::Vector3d(bell(random), bell(random), bell(random)).normalized();
      if (d.dot(towards) < -0.1) continue;
      ++i;
      const auto at = [](const Eigen::Vector3d& v) {
        return Eigen::Vector3d(v.normalized() * radius_towards(v.normalized()));
      };
      const Eigen::Vector3d u = d.unitOrthogonal();
      const Eigen::Vector3d v = d.cross(u);
      constexpr double kStep = 1e-4;
      const Eigen::Vector3d n =
          (at(d + kStep * u) - at(d - kStep * u)).cross(at(d + kStep * v) - at(d - kStep * v)).normalized();
      const Eigen::Vector3d about = Eigen::Map<const Eigen::Vector3d>(poses[s].about.data());
      const Eigen::Vector3d shift = Eigen::Map<const Eigen::Vector3d>(poses[s].shift.data());
      const double angle = about.norm();
      Eigen::Matrix3d r = Eigen::Matrix3d::Identity();
      if (angle > 0) r = Eigen::AngleAxisd(angle, about.normalized()).toRotationMatrix();
      const Eigen::Vector3d p = r * (at(d) + noise * bell(random) * n) + shift;
      const Eigen::Vector3f m = (r * n).cast<float>();
      out.points.x.push_back(p.x()), out.points.y.push_back(p.y()), out.points.z.push_back(p.z());
      out.points.nx.push_back(m.x()), out.points.ny.push_back(m.y()), out.points.nz.push_back(m.z());
    }
  }
  return out;
}

constexpr std::size_t kEach = 15000;
constexpr double kNoise = 0.002;

const std::vector<Pose>& wrong_poses() {
  static const std::vector<Pose> poses{{{0.004, -0.003, 0.002}, {0.006, 0.002, -0.004}},
                                       {{-0.002, 0.004, 0.003}, {-0.004, 0.005, 0.003}},
                                       {{0.001, -0.004, -0.003}, {0.002, -0.006, 0.004}},
                                       {{-0.003, 0.003, -0.002}, {-0.004, -0.001, -0.003}}};
  return poses;
}

SampleBatch all_of(PointSource& source) {
  SampleBatch all;
  source.read(0, source.info().count, all);
  return all;
}

/// Root mean square distance of the points from the ball, after the mean of the error that a shift of all makes.
double error_of(const SampleBatch& p) {
  std::vector<double> errors;
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < p.size(); ++i) {
    const Eigen::Vector3d at(p.x[i], p.y[i], p.z[i]);
    const Eigen::Vector3d d = at.normalized();
    errors.push_back(at.norm() - radius_towards(d));
    a += d * d.transpose();
    b += errors.back() * d;
  }
  const Eigen::Vector3d shift = a.ldlt().solve(b);
  double squared = 0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const double rest = errors[i] - shift.dot(Eigen::Vector3d(p.x[i], p.y[i], p.z[i]).normalized());
    squared += rest * rest;
  }
  return std::sqrt(squared / static_cast<double>(p.size()));
}

SampleBatch aligned(const Scanned& cloud, ScanAlignment& found) {
  return all_of(*align_scans(std::make_unique<ScannedSource>(cloud), found, {}));
}

TEST(AlignScans, ScansThatDisagreeAreMovedUntilNoiseIsLeft) {
  const Scanned cloud = scan(wrong_poses(), kNoise, kEach);
  ASSERT_GT(error_of(cloud.points), 2 * kNoise);
  ScanAlignment found;
  const SampleBatch after = aligned(cloud, found);
  EXPECT_EQ(found.scans, 4U);
  EXPECT_GT(found.places, 10'000U);
  EXPECT_LT(found.after, 0.3 * found.before);
  EXPECT_GT(found.farthest, 0.004);
  EXPECT_LT(found.farthest, 0.02);
  EXPECT_LT(error_of(after), 1.1 * kNoise);
  for (std::size_t i = 0; i < after.size(); i += 1000) {
    EXPECT_NEAR(std::hypot(after.nx[i], after.ny[i], after.nz[i]), 1, 1e-5);
  }
}

TEST(AlignScans, AnAttributeTellsScansWhereverTheirRowsAre) {
  Scanned cloud = scan(wrong_poses(), kNoise, kEach);
  ScanAlignment by_rows;
  const SampleBatch rows = aligned(cloud, by_rows);
  cloud.attributes = {{"scan", ScalarType::uint8}};
  std::vector<float> ids;
  for (std::size_t s = 0; s < cloud.parts.size(); ++s) ids.insert(ids.end(), kEach, static_cast<float>(7 * s));
  cloud.points.attributes = {ids};
  cloud.parts.clear();
  ScanAlignment by_value;
  const SampleBatch values = aligned(cloud, by_value);
  EXPECT_EQ(by_value.scans, 4U);
  EXPECT_EQ(rows.x, values.x);
  EXPECT_EQ(rows.nz, values.nz);
}

TEST(AlignScans, ScansThatAgreeStayToTheBit) {
  const Scanned cloud = scan(std::vector<Pose>(4, Pose{}), kNoise, kEach);
  ScanAlignment found;
  const SampleBatch after = aligned(cloud, found);
  EXPECT_FALSE(found.moved());
  EXPECT_EQ(found.before, found.after);
  EXPECT_EQ(after.x, cloud.points.x);
  EXPECT_EQ(after.ny, cloud.points.ny);
}

TEST(AlignScans, OneScanAndScansThatSeeNothingTogetherStay) {
  ScanAlignment found;
  const Scanned one = scan({{{}, {0.01, 0, 0}}}, kNoise, kEach);
  EXPECT_EQ(aligned(one, found).x, one.points.x);
  EXPECT_EQ(found.scans, 1U);
  // The second half of the rows is a ball far away.
  Scanned apart = scan({{{}, {0, 0, 0}}, {{}, {9, 0, 0}}}, kNoise, kEach);
  EXPECT_EQ(aligned(apart, found).x, apart.points.x);
  EXPECT_FALSE(found.moved());
}

TEST(AlignScans, StraysDoNotMoveScans) {
  Scanned cloud = scan(wrong_poses(), kNoise, kEach);
  std::mt19937 random(8);
  std::uniform_real_distribution<> place(-1.5, 1.5);
  for (std::size_t i = 0; i < cloud.points.size(); i += 20)
    cloud.points.x[i] = place(random), cloud.points.y[i] = place(random), cloud.points.z[i] = place(random);
  ScanAlignment found;
  SampleBatch after = aligned(cloud, found);
  SampleBatch kept;
  for (std::size_t i = 0; i < after.size(); ++i) {
    if (i % 20 == 0) continue;
    kept.x.push_back(after.x[i]), kept.y.push_back(after.y[i]), kept.z.push_back(after.z[i]);
  }
  EXPECT_LT(error_of(kept), 1.15 * kNoise);
}

}  // namespace
}  // namespace lamina

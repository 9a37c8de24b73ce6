#include "store/ingest.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <Eigen/LU>
#include <limits>

#include "reconstruct/clouds.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;

Survey survey_of(const Cloud& cloud, PlyFormat format = PlyFormat::little_endian, const RunContext& run = {}) {
  const test::TemporaryFolder folder;
  const auto source = open_points(test::write_cloud(cloud, folder / "in.ply", format, ScalarType::float64));
  return survey_input(*source, BadSamples::drop, run);
}

// Against the formulas in long double, far from the origin, where a careless sum of squares has no digits left.
RC_GTEST_PROP(Survey, MomentsAreThoseOfTheCloud, (unsigned seed)) {
  std::mt19937 random(seed);
  const double offset = std::exp2(*rc::gen::inRange(0, 30));
  const auto count = static_cast<std::size_t>(*rc::gen::inRange(2, 400));
  Cloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    const Point3 v = test::random_direction(random);
    cloud.add({offset + 3 * v[0], v[1] - v[0], 0.1 * v[2] - offset}, v);
  }
  const Survey survey = survey_of(cloud);
  std::array<long double, 3> mean{};
  for (std::size_t k = 0; k < 3; ++k) {
    double low = std::numeric_limits<double>::infinity();
    double high = -std::numeric_limits<double>::infinity();
    for (const Point3& p : cloud.positions) {
      mean[k] += p[k] / static_cast<long double>(count);
      low = std::min(low, p[k]);
      high = std::max(high, p[k]);
    }
    RC_ASSERT(survey.low[static_cast<int>(k)] == low);
    RC_ASSERT(survey.high[static_cast<int>(k)] == high);
  }
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t b = 0; b < 3; ++b) {
      long double c = 0;
      for (const Point3& p : cloud.positions)
        c += (p[a] - mean[a]) * (p[b] - mean[b]) / static_cast<long double>(count);
      const double found = survey.covariance(static_cast<int>(a), static_cast<int>(b));
      RC_ASSERT(std::abs(found - static_cast<double>(c)) < 1e-9);
    }
  }
}

TEST(Survey, DefectsAreToldApartAndCounted) {
  Cloud cloud = test::sphere_cloud(200);
  cloud.add_property("radius", ScalarType::float32, [](const Point3&) { return 1.0; });
  cloud.add_property("quality", ScalarType::float32, [](const Point3&) { return 2.0; });
  cloud.positions[5][0] = std::numeric_limits<double>::quiet_NaN();
  cloud.positions[6][1] = std::numeric_limits<double>::infinity();
  cloud.positions[7][2] = -std::numeric_limits<double>::infinity();
  cloud.normals[20] = {0, 0, 0};
  cloud.normals[21][1] = std::numeric_limits<double>::quiet_NaN();
  cloud.normals[22] = {1e-20, 0, 0};
  cloud.normals[23][2] = std::numeric_limits<double>::infinity();
  cloud.values[0][30] = 0;
  cloud.values[0][31] = -1;
  cloud.values[0][32] = std::numeric_limits<double>::quiet_NaN();
  cloud.values[0][33] = std::numeric_limits<double>::infinity();
  cloud.values[1][40] = -1;
  cloud.values[1][41] = std::numeric_limits<double>::quiet_NaN();
  cloud.values[1][42] = 7;
  cloud.normals[50] = {100, 0, 0};  // any length will do
  for (const PlyFormat format : {PlyFormat::ascii, PlyFormat::big_endian}) {
    const Survey s = survey_of(cloud, format);
    const auto rejected = [&](Defect d) { return s.rejected[static_cast<std::size_t>(d)]; };
    const auto first = [&](Defect d) { return s.first_row[static_cast<std::size_t>(d)]; };
    EXPECT_EQ(rejected(Defect::position), 3u);
    EXPECT_EQ(first(Defect::position), 5u);
    EXPECT_EQ(rejected(Defect::normal), 4u);
    EXPECT_EQ(first(Defect::normal), 20u);
    EXPECT_EQ(rejected(Defect::radius), 4u);
    EXPECT_EQ(first(Defect::radius), 30u);
    EXPECT_EQ(rejected(Defect::quality), 2u);
    EXPECT_EQ(first(Defect::quality), 40u);
    EXPECT_EQ(s.usable, 187u);
    EXPECT_EQ(s.max_quality, 7);
  }
}

TEST(Survey, RowsAreCountedAcrossPieces) {
  Cloud cloud = test::sphere_cloud(140000);
  cloud.add_property("t", ScalarType::float32, [](const Point3&) { return 0.0; });
  cloud.positions[139999][0] = std::numeric_limits<double>::quiet_NaN();
  cloud.values[0][131073] = std::numeric_limits<double>::infinity();
  std::vector<std::uint64_t> steps;
  RunContext run;
  run.progress = [&](const Progress& p) {
    EXPECT_EQ(p.samples_total, 140000u);
    steps.push_back(p.samples_done);
  };
  const Survey s = survey_of(cloud, PlyFormat::ascii, run);
  EXPECT_EQ(s.first_row[static_cast<std::size_t>(Defect::position)], 139999u);
  EXPECT_EQ(s.first_unusable_attribute, 131073u);
  EXPECT_EQ(s.unusable_attributes, 1u);
  ASSERT_GT(steps.size(), 1u);
  EXPECT_TRUE(std::is_sorted(steps.begin(), steps.end()));
  EXPECT_EQ(steps.back(), 140000u);
}

// The frame is a rotation whose last axis is the longest, and every sample keeps within 2^29 steps.
RC_GTEST_PROP(Survey, FramesHoldTheCloud, (unsigned seed)) {
  std::mt19937 random(seed);
  const double size = std::exp2(*rc::gen::inRange(-300, 300));
  const double flat = std::exp2(-*rc::gen::inRange(0, 40));
  Cloud cloud;
  for (int i = 0; i < 50; ++i) {
    const Point3 v = test::random_direction(random);
    const Point3 w = test::random_direction(random);
    cloud.add({size * (v[0] + 4 * w[1] * flat), size * v[1] * flat, size * v[0] * 2}, v);
  }
  const Survey survey = survey_of(cloud);
  for (const FrameMode mode : {FrameMode::pca, FrameMode::axis}) {
    const Frame frame = choose_frame(survey, mode);
    RC_ASSERT((frame.rotation * frame.rotation.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-12);
    RC_ASSERT(std::abs(frame.rotation.determinant() - 1) < 1e-12);
    int exponent = 0;
    RC_ASSERT(std::frexp(frame.step, &exponent) == 0.5);
    Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
    Eigen::Vector3d high = -low;
    for (const Point3& p : cloud.positions) {
      const Eigen::Vector3d local = frame.to_local({p[0], p[1], p[2]});
      RC_ASSERT(local.cwiseAbs().maxCoeff() <= 1 << 29);
      RC_ASSERT((frame.to_world(local) - Eigen::Vector3d(p[0], p[1], p[2])).norm() <= 1e-14 * size * 16);
      low = low.cwiseMin(local);
      high = high.cwiseMax(local);
    }
    RC_ASSERT((high - low).maxCoeff() >= 1 << 27);  // precision is not wasted
    if (mode == FrameMode::axis) RC_ASSERT((high - low)[2] == (high - low).maxCoeff());
  }
}

TEST(Survey, FloorsAreSpreadAlongTheSweepAxis) {
  // A tower, 1 x 1 x 3: by its axes alone, its floor would lie in one slab.
  Cloud cloud;
  for (int i = 0; i <= 20; ++i)
    for (int j = 0; j <= 20; ++j)
      for (const double z : {0.0, 1.0, 2.0, 3.0}) cloud.add({i / 20.0, j / 20.0, z}, {0, 0, 1});
  const Frame frame = choose_frame(survey_of(cloud), FrameMode::pca);
  double low = 0, high = 0;
  for (const Point3& corner : {Point3{0, 0, 0}, Point3{1, 0, 0}, Point3{0, 1, 0}, Point3{1, 1, 0}}) {
    const double z = (frame.rotation * Eigen::Vector3d(corner[0], corner[1], corner[2])).z();
    low = std::min(low, z);
    high = std::max(high, z);
  }
  EXPECT_GT(high - low, 0.05);
  EXPECT_LT(high - low, 0.15) << "the cross-section grows";
}

TEST(Survey, UsableAttributes) {
  EXPECT_EQ(usable_attribute(static_cast<float>(std::numeric_limits<double>::quiet_NaN())), 0);
  EXPECT_EQ(usable_attribute(-3.5F), -3.5F);
  EXPECT_EQ(usable_attribute(static_cast<float>(-std::numeric_limits<double>::infinity())), -kLargestAttribute);
  EXPECT_EQ(usable_attribute(3e38F), kLargestAttribute);
}

}  // namespace
}  // namespace lamina

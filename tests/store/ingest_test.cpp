#include "store/ingest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "reconstruct/clouds.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;

struct Stored {
  Frame frame;
  Extent extent;
  LocalSamples samples;  ///< of all buckets in order
  std::size_t buckets = 0;
};

Stored store(const Cloud& cloud, double radius_scale = 1) {
  const test::TemporaryFolder folder;
  const auto source = open_points(test::write_cloud(cloud, folder / "in.ply", PlyFormat::ascii, ScalarType::float64));
  const Survey survey = survey_input(*source, BadSamples::drop, {});
  Stored out;
  out.frame = choose_frame(survey, FrameMode::pca);
  const Ingested ingested = ingest(*source, survey, out.frame, folder.path(), {}, {radius_scale});
  EXPECT_EQ(folder.entries(), 1);  // the store has no name
  out.extent = ingested.extent;
  out.buckets = ingested.store.buckets();
  LocalSamples bucket;
  std::int32_t top = std::numeric_limits<std::int32_t>::min();
  for (std::size_t b = 0; b < ingested.store.buckets(); ++b) {
    if (ingested.store.count(b) == 0) continue;
    EXPECT_GT(ingested.store.z_lower(b), top);
    top = ingested.store.z_upper(b);
    ingested.store.read(b, bucket);
    const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
    append(out.samples.x, bucket.x);
    append(out.samples.y, bucket.y);
    append(out.samples.z, bucket.z);
    append(out.samples.nx, bucket.nx);
    append(out.samples.ny, bucket.ny);
    append(out.samples.nz, bucket.nz);
    append(out.samples.radius, bucket.radius);
    append(out.samples.quality, bucket.quality);
    out.samples.attributes.resize(bucket.attributes.size());
    for (std::size_t a = 0; a < bucket.attributes.size(); ++a) append(out.samples.attributes[a], bucket.attributes[a]);
  }
  return out;
}

/// The row a stored sample came from is its attribute.
TEST(Ingest, EverySampleArrivesTurnedAndRounded) {
  Cloud cloud = test::sphere_cloud(100000, [](const Point3& v) { return v[1] > 0 ? 1.0 : 0.3; });
  for (Point3& n : cloud.normals) {
    for (double& c : n) c *= 17;  // any length
  }
  cloud.positions[77][0] = std::nan("");
  cloud.normals[99999] = {0, 0, 0};
  double row = 0;
  cloud.add_property("row", ScalarType::uint32, [&](const Point3&) { return row++; });
  const Stored s = store(cloud);
  EXPECT_GT(s.buckets, 1u);
  ASSERT_EQ(s.samples.size(), cloud.size() - 2);
  std::vector<int> seen(cloud.size());
  Extent extent{{0, 0, 0, 0}, 0, 0};
  for (std::size_t i = 0; i < s.samples.size(); ++i) {
    const auto r = static_cast<std::size_t>(s.samples.attributes[0][i]);
    ++seen[r];
    const Point3& p = cloud.positions[r];
    const Eigen::Vector3d local = s.frame.to_local({p[0], p[1], p[2]});
    ASSERT_LE(std::abs(local[0] - s.samples.x[i]), 0.501);
    ASSERT_LE(std::abs(local[1] - s.samples.y[i]), 0.501);
    ASSERT_LE(std::abs(local[2] - s.samples.z[i]), 0.501);
    const Point3& n = cloud.normals[r];
    const Eigen::Vector3d turned = s.frame.rotation * Eigen::Vector3d(n[0], n[1], n[2]) / 17;
    ASSERT_LT((turned - Eigen::Vector3d(s.samples.nx[i], s.samples.ny[i], s.samples.nz[i])).norm(), 1e-6);
    extent.x_min = std::min(extent.x_min, s.samples.x[i]);
    extent.x_max = std::max(extent.x_max, s.samples.x[i]);
    extent.y_min = std::min(extent.y_min, s.samples.y[i]);
    extent.y_max = std::max(extent.y_max, s.samples.y[i]);
    extent.z_min = std::min(extent.z_min, s.samples.z[i]);
    extent.z_max = std::max(extent.z_max, s.samples.z[i]);
  }
  for (std::size_t r = 0; r < seen.size(); ++r) ASSERT_EQ(seen[r], r == 77 || r == 99999 ? 0 : 1);
  EXPECT_EQ(s.extent.x_min, extent.x_min);
  EXPECT_EQ(s.extent.x_max, extent.x_max);
  EXPECT_EQ(s.extent.y_min, extent.y_min);
  EXPECT_EQ(s.extent.y_max, extent.y_max);
  EXPECT_EQ(s.extent.z_min, extent.z_min);
  EXPECT_EQ(s.extent.z_max, extent.z_max);
}

TEST(Ingest, RadiiAreScaledAndBoundedByTheCloud) {
  Cloud cloud = test::sphere_cloud(100);
  cloud.add_property("radius", ScalarType::float32, [](const Point3&) { return 0.25; });
  cloud.values[0][0] = 1e38;
  cloud.values[0][1] = 1e-38;
  const Stored s = store(cloud, 3);
  std::size_t usual = 0;
  for (const float r : s.samples.radius) {
    ASSERT_GE(r, 1);
    ASSERT_LE(r, 1 << 30);
    usual += std::abs(r * s.frame.step - 0.75) < 1e-6 ? 1 : 0;
  }
  EXPECT_EQ(usual, 98u);
}

TEST(Ingest, QualityIsBroughtBelowOneByAPowerOfTwo) {
  for (const double largest : {3e38, 1000.0, 1.0, 1e-30}) {
    Cloud cloud = test::sphere_cloud(100);
    cloud.add_property("quality", ScalarType::float32, [&](const Point3&) { return largest; });
    cloud.values[0][0] = largest / 4;
    const Stored s = store(cloud);
    const auto [low, high] = std::minmax_element(s.samples.quality.begin(), s.samples.quality.end());
    EXPECT_LE(*high, 1);
    EXPECT_GT(*high, 0.5);
    EXPECT_FLOAT_EQ(*low * 4, *high);
    int exponent = 0;
    EXPECT_EQ(std::frexp(*high / static_cast<float>(largest), &exponent), 0.5F) << largest;
  }
}

TEST(Ingest, QualitiesThatAreAllZeroTellNoWeights) {
  Cloud cloud = test::sphere_cloud(100);
  cloud.add_property("quality", ScalarType::float32, [](const Point3&) { return 0.0; });
  EXPECT_THAT(store(cloud).samples.quality, ::testing::Each(1.0F));
}

TEST(StoreSettings, BucketsAreAsSmallAsTheBufferAllows) {
  Survey survey;
  survey.low = {0, 0, 0};
  survey.high = {1, 1, 1};
  const auto settings_for = [&](std::uint64_t samples) {
    survey.usable = samples;
    return store_settings(survey, choose_frame(survey, FrameMode::axis), {testing::TempDir()});
  };
  std::size_t buckets = 0;
  for (const std::uint64_t samples :
       {1'000ULL, 1'000'000ULL, 4'000'000ULL, 60'000'000ULL, 140'000'000ULL, 400'000'000ULL, 10'000'000'000ULL}) {
    const StoreSettings s = settings_for(samples);
    EXPECT_GE(s.buckets, buckets) << samples;
    buckets = s.buckets;
    // Of samples in random order each bucket has some kilobytes of the buffer, and blocks are no shorter.
    EXPECT_GE(s.buffer_bytes / s.buckets, 8000U) << samples;
    EXPECT_GE(static_cast<std::int64_t>(s.buckets) * s.bucket_height, 2 * std::int64_t{-s.z_min}) << samples;
    if (samples >= 4'000'000 && samples <= 60'000'000) {
      EXPECT_LE(samples / s.buckets, 16'384U) << samples;
    }
  }
  EXPECT_GT(buckets, 16'000U);
}

}  // namespace
}  // namespace lamina

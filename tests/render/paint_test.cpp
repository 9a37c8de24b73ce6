#include "lamina/render.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "lamina/error.h"
#include "render/shapes.h"

namespace lamina {
namespace {

TEST(Paint, DistancesAreThoseOfConcentricSpheres) {
  const TriangleMesh truth = test::sphere(1, 120), outer = test::sphere(1.25, 20);
  for (const double d : vertex_distances(outer, truth)) EXPECT_NEAR(d, 0.25, 1e-3);
  for (const double d : vertex_distances(truth, truth)) EXPECT_NEAR(d, 0, 1e-9);
}

TEST(Paint, DistancesWantATruthWithFaces) {
  TriangleMesh cloud = test::sphere(1, 8);
  cloud.triangles.clear();
  EXPECT_THROW(vertex_distances(test::sphere(1, 8), cloud), Error);
}

TEST(Paint, TheRangeLeavesOutTheLargestPerCent) {
  std::vector<double> values(1000);
  std::iota(values.rbegin(), values.rend(), 1.0);  // 1 to 1000
  values.push_back(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(paint_range(values).low, 0);
  EXPECT_EQ(paint_range(values).high, 990);
  values[5] = -3;
  EXPECT_EQ(paint_range(values).low, -3);
  EXPECT_EQ(paint_range({}).high, 0);
}

TEST(Paint, ColoursRunFromBlueToRedWithoutJumps) {
  const PaintRange range{2, 4};
  const auto low = paint_colour(2, range), high = paint_colour(4, range);
  EXPECT_GT(low[2], low[0] + 80);
  EXPECT_GT(high[0], high[2] + 80);
  EXPECT_EQ(paint_colour(-9, range), low);
  EXPECT_EQ(paint_colour(9, range), high);
  const auto unknown = paint_colour(std::nan(""), range);
  EXPECT_TRUE(unknown[0] == unknown[1] && unknown[1] == unknown[2]);
  for (double v = 2; v < 4; v += 0.01) {
    const auto a = paint_colour(v, range), b = paint_colour(v + 0.01, range);
    for (std::size_t c = 0; c < 3; ++c) EXPECT_LE(std::abs(a[c] - b[c]), 6);
  }
}

TEST(Paint, ReplacesColoursAndKeepsTheRest) {
  TriangleMesh mesh = test::square(1, 0, {0.1F, 0.2F, 0.3F}, ScalarType::float32);
  mesh.layout.insert(mesh.layout.begin(), {"quality", ScalarType::float32});
  mesh.attributes.insert(mesh.attributes.begin(), {5, 6, 7, 8});
  const PaintRange range{0, 3};
  paint(mesh, {0, 1, 2, 3}, range);
  ASSERT_EQ(mesh.layout.size(), 4u);
  EXPECT_EQ(mesh.attributes[0], (std::vector<float>{5, 6, 7, 8}));
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_EQ(mesh.layout[1 + c].type, ScalarType::uint8);
    for (std::size_t v = 0; v < 4; ++v)
      EXPECT_EQ(mesh.attributes[1 + c][v], paint_colour(static_cast<double>(v), range)[c]);
  }
}

TEST(Paint, PointsGetDistancesAndTheColoursOfTheirValues) {
  SampleBatch points;
  points.x = {0, 0, 3}, points.y = {0, 2, 0}, points.z = {1.5, 0, 0};
  points.radius = {1, 2, 3};
  points.attributes = {{4, 5, 6}};
  AttributeLayout layout{{"warmth", ScalarType::float32}};
  const DistanceField field(test::sphere(1, 200));
  const std::vector<double> distances = field.of(points);
  const std::vector<double> truth{0.5, 1, 2};
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(distances[i], truth[i], 1e-3);
  EXPECT_EQ(point_values(points, layout, "pscale"), (std::vector<double>{1, 2, 3}));
  EXPECT_EQ(point_values(points, layout, "warmth"), (std::vector<double>{4, 5, 6}));
  EXPECT_TRUE(point_values(points, layout, "quality").empty());
  const PaintRange range{0, 2};
  paint(points, layout, truth, range);
  ASSERT_EQ(layout.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(points.attributes[c][i], paint_colour(truth[i], range)[c]);
}

TEST(Paint, AScaleOfManyValuesIsNearlyThatOfAll) {
  std::vector<double> values(3'000'000);
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] = static_cast<double>(i * 2'654'435'761U % values.size()) / static_cast<double>(values.size());
  PaintScale scale, whole;
  whole.add(values);
  for (std::size_t i = 0; i < values.size(); i += 700'001)
    scale.add({values.begin() + static_cast<std::ptrdiff_t>(i),
               values.begin() + static_cast<std::ptrdiff_t>(std::min(i + 700'001, values.size()))});
  EXPECT_EQ(scale.range().high, whole.range().high);
  EXPECT_NEAR(scale.range().high, 0.99, 1e-3);
  EXPECT_EQ(scale.least(), *std::min_element(values.begin(), values.end()));
  EXPECT_EQ(scale.most(), *std::max_element(values.begin(), values.end()));
}

}  // namespace
}  // namespace lamina

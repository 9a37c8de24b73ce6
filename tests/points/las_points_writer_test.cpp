// LAS as written comes back: positions to the step, everything else exactly.
#include "points/formats.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/temporary_folder.h"
#include "points/point_rows.h"

namespace lamina {
namespace {

TEST(LasPointsWriter, RowsComeBack) {
  const test::TemporaryFolder folder;
  PointColumns columns{.double_positions = true, .normals = true, .radius = "radius", .quality = "quality"};
  columns.attributes = {{"intensity", ScalarType::uint16},
                        {"red", ScalarType::uint16},
                        {"green", ScalarType::uint16},
                        {"blue", ScalarType::uint16}};
  for (int t = 0; t < 8; ++t) columns.attributes.push_back({"a" + std::to_string(t), static_cast<ScalarType>(t)});
  const SampleBatch rows = test::random_rows(columns, 9000, 5);
  test::write_rows(folder / "a.las", columns, rows);
  EXPECT_EQ(folder.entries(), 1);
  const auto source = open_points(folder / "a.las");
  EXPECT_EQ(columns_of(source->info()), columns);
  EXPECT_FALSE(source->info().geographic);
  const SampleBatch back = test::all_rows(*source);
  ASSERT_EQ(back.size(), rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    // 160 units of extent: steps of 1e-7.
    ASSERT_NEAR(back.x[i], rows.x[i], 0.51e-7);
    ASSERT_NEAR(back.z[i], rows.z[i], 0.51e-7);
  }
  EXPECT_TRUE(back.nx == rows.nx && back.nz == rows.nz && back.radius == rows.radius && back.quality == rows.quality);
  EXPECT_TRUE(back.attributes == rows.attributes && back.exact == rows.exact);
}

TEST(LasPointsWriter, EveryKindOfColourBecomesSixteenBits) {
  const test::TemporaryFolder folder;
  const auto red_of = [&](ScalarType type, float value) {
    const PointColumns columns{.attributes = {{"red", type}, {"green", type}, {"blue", type}}};
    SampleBatch rows;
    rows.x = rows.y = rows.z = {1};
    rows.attributes = {{value}, {1}, {1}};
    test::write_rows(folder / "a.las", columns, rows);
    const auto source = open_points(folder / "a.las");
    EXPECT_EQ(source->info().attributes[0], (AttributeSpec{"red", ScalarType::uint16}));
    return test::all_rows(*source).attributes[0][0];
  };
  EXPECT_EQ(red_of(ScalarType::uint8, 255), 65535);
  EXPECT_EQ(red_of(ScalarType::uint8, 2), 514);
  EXPECT_EQ(red_of(ScalarType::uint16, 300), 300);
  EXPECT_EQ(red_of(ScalarType::float32, 0.5F), 32768);
}

TEST(LasPointsWriter, StepsAreTheFinestPowerOfTenThatSpansThePoints) {
  struct Case {
    double low, high, scale;
  };
  for (const Case& c : {Case{0, 1, 1e-9}, Case{4e5, 4e5 + 100, 1e-7}, Case{-5e6, 5e6, 1e-2}, Case{3, 3, 1e-3},
                        Case{0, 0, 1e-3}, Case{4.5e6, 4.5e6 + 1e-6, 1e-9}, Case{0, 1e-9, 1e-18}}) {
    const LasAxis axis = choose_steps(c.low, c.high);
    for (const double v : {c.low, c.high}) {
      const double steps = (v - axis.offset) / axis.scale;
      EXPECT_LE(std::abs(steps), 2147483647.0) << c.low << " " << c.high;
      EXPECT_NEAR(std::round(steps) * axis.scale + axis.offset, v, 0.51 * axis.scale + std::abs(v) * 1e-15);
    }
    EXPECT_LE(axis.scale, c.high == c.low ? 1e-3 : 1e-8 * (c.high - c.low) + std::abs(c.high) * 1e-14);
  }
}

TEST(LasPointsWriter, StepsAreNoFinerThanTheCoordinates) {
  const auto steps_of = [](const std::vector<double>& values) {
    Decimals decimals;
    for (const double v : values) decimals.add(v);
    return choose_steps(values.front(), values.back(), decimals.most()).scale;
  };
  EXPECT_EQ(steps_of({636001.76, 636002.8, 637179.22}), 0.01);
  EXPECT_EQ(steps_of({-12.125, 3, 80}), 0.001);
  EXPECT_EQ(steps_of({0, 7, 90}), 1);
  EXPECT_EQ(steps_of({0, 1.0 / 3, 90}), 1e-7);
  // Every step of a file is kept, whatever the offset it counts from.
  Decimals decimals;
  for (int i = 0; i < 100'000; ++i) decimals.add(i * 16'807 % 2'000'003 * 0.001 + 4'567'890.5);
  EXPECT_EQ(decimals.most(), 3);
}

}  // namespace
}  // namespace lamina

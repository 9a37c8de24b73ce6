// E57: what the standard's kinds of fields become, and what comes back of points written by ourselves.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "base/temporary_folder.h"
#include "lamina/points.h"
#include "points/e57_files.h"
#include "points/point_rows.h"
#include "points/scans.h"

namespace lamina {
namespace {

using test::all_rows;
using test::e57_double;
using test::e57_float;
using test::e57_integer;
using test::E57TestFile;
using test::E57TestScan;
using testing::DoubleNear;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pointwise;

class E57Points : public ::testing::Test {
 protected:
  std::string write(const E57TestFile& file, const std::string& more = "") const {
    return test::write_file(folder_ / "cloud.e57", file.bytes(more));
  }
  test::TemporaryFolder folder_;
};

E57TestScan doubles(const std::vector<double>& x) {
  return {"", {e57_double("cartesianX", x), e57_double("cartesianY", x), e57_double("cartesianZ", x)}};
}

TEST_F(E57Points, PackedIntegersAcrossPacketsAndPages) {
  constexpr std::size_t kCount = 20'001;
  std::mt19937_64 random(7);
  std::vector<std::int64_t> a(kCount), b(kCount), c(kCount), d(kCount);
  for (std::size_t i = 0; i < kCount; ++i) {
    a[i] = static_cast<std::int64_t>(random() % 100'001) - 50'000;
    b[i] = static_cast<std::int64_t>(random() % 6) - 3;
    c[i] = static_cast<std::int64_t>(random());
    d[i] = static_cast<std::int64_t>(random() % 2);
  }
  const std::string scaled = R"(type="ScaledInteger" scale="0.001" offset="100")";
  E57TestFile file;
  file.add({"",
            {e57_integer("cartesianX", -50'000, 50'000, a, scaled), e57_integer("cartesianY", -3, 2, b),
             e57_integer("cartesianZ", 5, 5, std::vector<std::int64_t>(kCount, 5)),
             e57_integer("ext:wide", INT64_MIN, INT64_MAX, c), e57_integer("ext:bit", 0, 1, d)},
            997});
  const auto source = open_points(write(file));
  ASSERT_EQ(source->info().count, kCount);
  EXPECT_EQ(source->info().attributes, (AttributeLayout{{"wide", ScalarType::float64}, {"bit", ScalarType::uint8}}));
  for (const std::size_t piece : {100'000, 777}) {
    const SampleBatch rows = all_rows(*source, piece);
    for (std::size_t i = 0; i < kCount; ++i) {
      ASSERT_DOUBLE_EQ(rows.x[i], static_cast<double>(a[i]) * 0.001 + 100) << i;
      ASSERT_EQ(rows.y[i], static_cast<double>(b[i])) << i;
      ASSERT_EQ(rows.z[i], 5) << i;
      ASSERT_EQ(rows.exact[0][i], static_cast<double>(c[i])) << i;
      ASSERT_EQ(rows.attributes[1][i], static_cast<float>(d[i])) << i;
    }
  }
}

TEST_F(E57Points, PosesTurnAndShiftAndTellWhereTheScannerStood) {
  E57TestFile file;
  E57TestScan turned = doubles({1, 2});  // a quarter about z, x to y
  turned.xml =
      "<pose type=\"Structure\"><rotation type=\"Structure\"><w type=\"Float\">0.70710678118654757</w>"
      "<x type=\"Float\"/><y type=\"Float\"/><z type=\"Float\">0.70710678118654757</z></rotation>"
      "<translation type=\"Structure\"><x type=\"Float\">10</x><y type=\"Float\">20</y>"
      "<z type=\"Float\">30</z></translation></pose>";
  file.add(turned);
  file.add(doubles({7}));
  const auto source = open_points(write(file));
  const SampleBatch rows = all_rows(*source);
  EXPECT_THAT(rows.x, Pointwise(DoubleNear(1e-12), {9.0, 8.0, 7.0}));
  EXPECT_THAT(rows.y, Pointwise(DoubleNear(1e-12), {21.0, 22.0, 7.0}));
  EXPECT_THAT(rows.z, Pointwise(DoubleNear(1e-12), {31.0, 32.0, 7.0}));
  ASSERT_EQ(source->info().scans.size(), 2);
  EXPECT_EQ(source->info().scans[0].scanner, ScanPart::Scanner::position);
  EXPECT_THAT(source->info().scans[0].at, ElementsAre(10, 20, 30));
  EXPECT_EQ(source->info().scans[1].scanner, ScanPart::Scanner::unknown);
  EXPECT_EQ(source->info().path, folder_ / "cloud.e57");
}

TEST_F(E57Points, AShiftAloneMayBeNoScanner) {
  E57TestFile file;
  E57TestScan scan = doubles({1});
  scan.xml =
      "<pose type=\"Structure\"><translation type=\"Structure\"><x type=\"Float\">400000</x></translation></pose>";
  file.add(scan);
  const auto source = open_points(write(file));
  EXPECT_EQ(source->info().scans.at(0).scanner, ScanPart::Scanner::pose_origin);
  EXPECT_EQ(all_rows(*source).x[0], 400001);
}

TEST_F(E57Points, AnglesBecomeCoordinates) {
  E57TestFile file;
  const double quarter = std::acos(-1) / 2;
  file.add({"",
            {e57_double("sphericalRange", {2, 2, 2}), e57_double("sphericalAzimuth", {0, quarter, 1}),
             e57_double("sphericalElevation", {0, 0, -quarter})}});
  const auto source = open_points(write(file));
  const SampleBatch rows = all_rows(*source);
  EXPECT_THAT(rows.x, Pointwise(DoubleNear(1e-12), {2.0, 0.0, 0.0}));
  EXPECT_THAT(rows.y, Pointwise(DoubleNear(1e-12), {0.0, 2.0, 0.0}));
  EXPECT_THAT(rows.z, Pointwise(DoubleNear(1e-12), {0.0, 0.0, -2.0}));
  EXPECT_EQ(source->info().scans.at(0).scanner, ScanPart::Scanner::position);
}

TEST_F(E57Points, InvalidPointsAreLeftOutAndCounted) {
  constexpr std::size_t kCount = 30'000;
  std::vector<double> x(kCount);
  std::vector<std::int64_t> state(kCount);
  std::vector<double> valid;
  for (std::size_t i = 0; i < kCount; ++i) {
    x[i] = static_cast<double>(i);
    state[i] = (i * i) % 7 == 2 || (i >= 8'000 && i < 17'000) ? 1 + static_cast<std::int64_t>(i % 2) : 0;
    if (state[i] == 0) valid.push_back(x[i]);
  }
  E57TestScan scan = doubles(x);
  scan.fields.push_back(e57_integer("cartesianInvalidState", 0, 2, state));
  E57TestFile file;
  file.add(scan);
  const auto source = open_points(write(file));
  ASSERT_EQ(source->info().count, valid.size());
  EXPECT_THAT(source->info().remarks,
              ElementsAre(HasSubstr(std::to_string(kCount - valid.size()) + " points are marked as invalid")));
  for (const std::size_t piece : {100'000, 613}) EXPECT_EQ(all_rows(*source, piece).x, valid);
  SampleBatch last;
  source->read(valid.size() - 2, 10, last);
  EXPECT_EQ(last.z, std::vector<double>(valid.end() - 2, valid.end()));
}

TEST_F(E57Points, RowsAndColumnsAreTheScannersGrid) {
  // Columns from left to right, each from the top down; one point is invalid, one place was never stored.
  E57TestScan scan = doubles({1, 2, 3, 4, 5});
  scan.fields.push_back(e57_integer("columnIndex", 0, 9, {4, 4, 5, 5, 5}));
  scan.fields.push_back(e57_integer("rowIndex", 0, 9, {2, 1, 3, 2, 1}));
  scan.fields.push_back(e57_integer("cartesianInvalidState", 0, 2, {0, 0, 0, 2, 0}));
  E57TestFile file;
  file.add(scan);
  scan.fields[3] = e57_integer("columnIndex", 0, 9, {4, 5, 4, 5, 4});  // in no order
  file.add(scan);
  const auto source = open_points(write(file));
  const std::vector<PlacedGrid> grids = grids_of(*source);
  ASSERT_EQ(grids.size(), 1);
  const ScanGrid& grid = *grids[0].grid;
  EXPECT_EQ(grid.length(), 3);
  EXPECT_EQ(grid.rows(), 4);
  std::vector<bool> places;
  for (std::uint64_t line = 0; line < 2; ++line) {
    for (std::uint64_t at = 0; at < 3; ++at) places.push_back(grid.has(line, at));
  }
  EXPECT_EQ(places, (std::vector<bool>{false, true, true, true, false, true}));
  EXPECT_EQ(source->info().scans.at(0).scanner, ScanPart::Scanner::position);
}

TEST_F(E57Points, ColoursAndIntensityByTheirLimits) {
  E57TestFile file;
  E57TestScan scan = doubles({1, 2});
  scan.xml =
      "<intensityLimits type=\"Structure\"><intensityMinimum type=\"Float\">-10</intensityMinimum>"
      "<intensityMaximum type=\"Float\">30</intensityMaximum></intensityLimits>"
      "<colorLimits type=\"Structure\"><colorRedMinimum type=\"Integer\"/>"
      "<colorRedMaximum type=\"Integer\">4095</colorRedMaximum></colorLimits>";
  scan.fields.push_back(e57_float("intensity", {-10, 20}));
  scan.fields.push_back(e57_integer("colorRed", 0, 4095, {4095, 1}));
  scan.fields.push_back(e57_integer("colorGreen", 0, 255, {255, 7}));
  scan.fields.push_back(e57_integer("colorBlue", 0, 65535, {65535, 9}));
  scan.fields.push_back(e57_integer("isColorInvalid", 0, 1, {0, 1}));
  file.add(scan);
  const auto source =
      open_points(write(file, "<coordinateMetadata type=\"String\">PROJCS[\"x\"]</coordinateMetadata>"));
  EXPECT_EQ(source->info().attributes, (AttributeLayout{{"intensity", ScalarType::float32},
                                                        {"red", ScalarType::uint16},
                                                        {"green", ScalarType::uint8},
                                                        {"blue", ScalarType::uint16}}));
  const SampleBatch rows = all_rows(*source);
  EXPECT_THAT(rows.attributes,
              ElementsAre(ElementsAre(0, 0.75F), ElementsAre(65535, 0), ElementsAre(255, 0), ElementsAre(65535, 0)));
  EXPECT_EQ(source->info().crs, "PROJCS[\"x\"]");
}

TEST_F(E57Points, DamageIsToldInOneLine) {
  E57TestFile file;
  file.add(doubles(std::vector<double>(500, 3)));
  const std::string good = file.bytes();
  const auto refused = [&](const std::string& bytes) {
    return test::refusal(test::write_file(folder_ / "d.e57", bytes));
  };
  EXPECT_EQ(refused(good), "");
  std::string bad = good;
  bad[3000] = static_cast<char>(bad[3000] ^ 4);
  EXPECT_THAT(refused(bad), HasSubstr("the page at byte 2048 is wrong"));
  EXPECT_EQ(test::refusal(folder_ / "d.e57", PointSettings{.ignore_checksums = true}), "");
  EXPECT_THAT(refused(good.substr(0, good.size() - 1024)), HasSubstr("was cut short"));
  EXPECT_THAT(refused(good.substr(0, 500)), HasSubstr("is cut short"));

  E57TestFile few;
  E57TestScan scan = doubles({1, 2, 3});
  scan.fields[1].values.pop_back();
  few.add(scan);
  EXPECT_THAT(refused(few.bytes()), HasSubstr("2 values of cartesianY"));
  E57TestFile none;
  none.add({"", {e57_double("cartesianX", {1})}});
  EXPECT_THAT(refused(none.bytes()), HasSubstr("neither Cartesian nor spherical"));
  EXPECT_THAT(refused(file.bytes("<guid>")), HasSubstr("of the XML section"));
}

TEST_F(E57Points, WithoutScansThereAreNoPoints) {
  EXPECT_EQ(open_points(write(E57TestFile{}))->info().count, 0);
}

TEST_F(E57Points, WhatIsWrittenComesBackExactly) {
  PointColumns columns{.double_positions = true, .normals = true, .radius = "radius", .quality = "confidence"};
  columns.attributes = {{"red", ScalarType::uint8},        {"green", ScalarType::uint8}, {"blue", ScalarType::uint8},
                        {"intensity", ScalarType::uint16}, {"a", ScalarType::int8},      {"b", ScalarType::int16},
                        {"c", ScalarType::uint32},         {"d", ScalarType::int32},     {"e", ScalarType::float32},
                        {"f", ScalarType::float64}};
  for (const std::size_t count : {0, 1, 5000}) {
    const SampleBatch rows = test::random_rows(columns, count, 5);
    const std::string path = folder_ / "out.e57";
    test::write_rows(path, columns, rows);
    const auto source = open_points(path);
    EXPECT_EQ(source->info().attributes.size(), columns.attributes.size());
    const SampleBatch back = all_rows(*source);
    EXPECT_EQ(back.x, rows.x);
    EXPECT_EQ(back.y, rows.y);
    EXPECT_EQ(back.z, rows.z);
    EXPECT_EQ(back.nx, rows.nx);
    EXPECT_EQ(back.nz, rows.nz);
    EXPECT_EQ(back.radius, rows.radius);
    EXPECT_EQ(back.quality, rows.quality);
    for (const AttributeSpec& spec : columns.attributes) {
      const auto from = find_attribute(columns.attributes, spec.name);
      const auto to = find_attribute(source->info().attributes, spec.name);
      ASSERT_TRUE(from && to) << spec.name;
      EXPECT_EQ(source->info().attributes[*to].type, spec.type) << spec.name;
      EXPECT_EQ(back.attributes[*to], rows.attributes[*from]) << spec.name;
      EXPECT_EQ(back.exact[*to], rows.exact[*from]) << spec.name;
    }
  }
}

TEST_F(E57Points, TheCoordinateSystemGoesAlong) {
  const PointColumns columns;
  test::write_rows(folder_ / "a.e57", columns, test::random_rows(columns, 3, 1), {.crs = "PROJCS[\"a < b & c\"]"});
  EXPECT_EQ(open_points(folder_ / "a.e57")->info().crs, "PROJCS[\"a < b & c\"]");
}

TEST_F(E57Points, TheSameRowsGiveTheSameBytes) {
  const PointColumns columns{.normals = true, .attributes = {{"intensity", ScalarType::float32}}};
  const SampleBatch rows = test::random_rows(columns, 3000, 9);
  test::write_rows(folder_ / "a.e57", columns, rows);
  test::write_rows(folder_ / "b.e57", columns, rows, {.count = 3000});
  EXPECT_EQ(test::read_file(folder_ / "a.e57"), test::read_file(folder_ / "b.e57"));
  EXPECT_EQ(all_rows(folder_ / "a.e57").attributes, rows.attributes);
}

}  // namespace
}  // namespace lamina

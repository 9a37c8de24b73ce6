// XYZ and CSV as written come back as they were.
#include "points/formats.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/temporary_folder.h"
#include "points/point_rows.h"

namespace lamina {
namespace {

using testing::HasSubstr;

const PointColumns kColumns{.double_positions = true,
                            .normals = true,
                            .radius = "pscale",
                            .quality = "confidence",
                            .attributes = {{"red", ScalarType::uint8},
                                           {"green", ScalarType::uint8},
                                           {"blue", ScalarType::uint8},
                                           {"label", ScalarType::int32},
                                           {"time", ScalarType::float64}}};

TEST(TextPointsWriter, RowsComeBackExactly) {
  const test::TemporaryFolder folder;
  for (const char* name : {"a.xyz", "a.csv"}) {
    for (const bool wide : {true, false}) {
      PointColumns columns = kColumns;
      columns.double_positions = wide;
      const SampleBatch rows = test::random_rows(columns, 3000, 4);
      test::write_rows(folder / name, columns, rows);
      // Types of whole columns are for the reader to be told; colours it finds out.
      const auto source = open_points(
          folder / name, PointSettings{{}, "x,y,z,nx,ny,nz,pscale,confidence,red,green,blue,label:int,time:double"});
      EXPECT_EQ(source->info().attributes, columns.attributes);
      const SampleBatch back = test::all_rows(*source);
      EXPECT_TRUE(!wide || (back.x == rows.x && back.y == rows.y && back.z == rows.z));
      for (std::size_t i = 0; i < rows.size(); ++i)
        ASSERT_EQ(static_cast<float>(back.x[i]), static_cast<float>(rows.x[i]));
      EXPECT_TRUE(back.nx == rows.nx && back.radius == rows.radius && back.quality == rows.quality);
      EXPECT_TRUE(back.attributes == rows.attributes && back.exact == rows.exact);
      EXPECT_EQ(test::attribute_names(open_points(folder / name)->info()), test::attribute_names(source->info()));
    }
  }
}

TEST(TextPointsWriter, LooksAsExpected) {
  const test::TemporaryFolder folder;
  SampleBatch rows;
  rows.x = {0.1, 2};
  rows.y = {1e-7, 3};
  rows.z = {-5, 4};
  rows.attributes = {{254.7F, -3}};
  for (const char* name : {"a.xyz", "a.csv"}) {
    test::write_rows(folder / name, {.attributes = {{"red", ScalarType::uint8}}}, rows);
  }
  EXPECT_EQ(test::read_file(folder / "a.xyz"), "# x y z red\n0.1 1e-07 -5 255\n2 3 4 0\n");
  EXPECT_EQ(test::read_file(folder / "a.csv"), "x,y,z,red\n0.1,1e-07,-5,255\n2,3,4,0\n");
}

TEST(TextPointsWriter, AnEmptyCloudComesBackToo) {
  const test::TemporaryFolder folder;
  for (const char* name : {"a.xyz", "a.csv", "a.pcd", "a.las"}) {
    test::write_rows(folder / name, kColumns, test::random_rows(kColumns, 0, 1), {.count = 0});
    EXPECT_EQ(open_points(folder / name)->info().count, 0) << name;
  }
}

TEST(TextPointsWriter, RefusesWhatNoReaderWouldUnderstand) {
  const test::TemporaryFolder folder;
  for (const char* name : {"a.xyz", "a.csv", "a.pcd"}) {
    EXPECT_THROW(open_points_writer(folder / name, {.attributes = {{"two words", ScalarType::int8}}}), Error) << name;
    EXPECT_THROW(open_points_writer(folder / name, {.radius = "a", .attributes = {{"a", ScalarType::int8}}}), Error);
    SampleBatch rows;
    rows.x = rows.y = rows.z = {std::nan("")};
    EXPECT_THROW(open_points_writer(folder / name, {})->append(rows), Error);
    const auto counted = open_points_writer(folder / name, {}, {.count = 1});
    EXPECT_THROW(counted->commit(), Error);
  }
  EXPECT_EQ(folder.entries(), 0);
}

}  // namespace
}  // namespace lamina

// PCD as written comes back as it was, colours packed on the way.
#include "points/formats.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/temporary_folder.h"
#include "points/point_rows.h"

namespace lamina {
namespace {

using testing::HasSubstr;

TEST(PcdPointsWriter, RowsOfEveryTypeComeBackExactly) {
  const test::TemporaryFolder folder;
  PointColumns columns{.double_positions = true, .normals = true, .radius = "radius", .quality = "quality"};
  for (int t = 0; t < 8; ++t) columns.attributes.push_back({"a" + std::to_string(t), static_cast<ScalarType>(t)});
  for (const auto& settings : {PointsWriterSettings{}, PointsWriterSettings{.count = 2000}}) {
    const SampleBatch rows = test::random_rows(columns, 2000, 2);
    test::write_rows(folder / "a.pcd", columns, rows, settings);
    const auto source = open_points(folder / "a.pcd");
    EXPECT_EQ(columns_of(source->info()), columns);
    const SampleBatch back = test::all_rows(*source);
    EXPECT_TRUE(back.x == rows.x && back.z == rows.z && back.ny == rows.ny);
    EXPECT_TRUE(back.radius == rows.radius && back.quality == rows.quality);
    EXPECT_TRUE(back.attributes == rows.attributes && back.exact == rows.exact);
  }
}

TEST(PcdPointsWriter, EightBitColoursArePackedAsThePointCloudLibraryDoes) {
  const test::TemporaryFolder folder;
  const PointColumns columns{.attributes = {{"red", ScalarType::uint8},
                                            {"label", ScalarType::uint32},
                                            {"green", ScalarType::uint8},
                                            {"blue", ScalarType::uint8}}};
  const SampleBatch rows = test::random_rows(columns, 500, 3);
  test::write_rows(folder / "a.pcd", columns, rows);
  EXPECT_THAT(test::read_file(folder / "a.pcd"), HasSubstr("FIELDS x y z label rgb\nSIZE 4 4 4 4 4\nTYPE F F F U F\n"));
  const SampleBatch back = test::all_rows(folder / "a.pcd");
  EXPECT_TRUE(back.exact[0] == rows.exact[1]);
  EXPECT_TRUE(back.attributes[1] == rows.attributes[0] && back.attributes[2] == rows.attributes[2] &&
              back.attributes[3] == rows.attributes[3]);
}

TEST(PcdPointsWriter, SixteenBitColoursArePackedInEight) {
  const test::TemporaryFolder folder;
  const PointColumns columns{
      .attributes = {{"red", ScalarType::uint16}, {"green", ScalarType::uint16}, {"blue", ScalarType::uint16}}};
  SampleBatch rows = test::random_rows(columns, 3, 3);
  for (auto& channel : rows.attributes) channel = {0, 257 * 100 + 50, 65535};
  test::write_rows(folder / "a.pcd", columns, rows);
  EXPECT_THAT(test::read_file(folder / "a.pcd"), HasSubstr("FIELDS x y z rgb\n"));
  for (const auto& channel : test::all_rows(folder / "a.pcd").attributes)
    EXPECT_THAT(channel, ::testing::ElementsAre(0, 100, 255));
}

}  // namespace
}  // namespace lamina

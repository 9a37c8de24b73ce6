// Points grids come through open_points like any other format.
#include "points/formats.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "base/temporary_folder.h"
#include "lamina/volume_points.h"
#include "points/point_rows.h"
#include "support/paths.h"

namespace lamina {
namespace {

using testing::HasSubstr;

TEST(VdbPoints, AreRowsLikeAnyOther) {
  const test::TemporaryFolder folder;
  const PointColumns columns{.normals = true,
                             .radius = "pscale",
                             .attributes = {{"red", ScalarType::uint8},
                                            {"green", ScalarType::uint8},
                                            {"blue", ScalarType::uint8},
                                            {"label", ScalarType::int32}}};
  PointArrays cloud{test::random_rows(columns, 2000, 8), columns.attributes};
  for (std::size_t i = 0; i < 2000; ++i) cloud.samples.exact[3][i] = static_cast<double>(i);
  for (std::size_t i = 0; i < 2000; ++i) cloud.samples.attributes[3][i] = static_cast<float>(i);
  write_point_volume(cloud, {}, folder / "a.vdb");
  const auto source = open_points(folder / "a.vdb");
  EXPECT_EQ(source->info().count, 2000);
  EXPECT_TRUE(source->info().has_normals && source->info().has_radius && source->info().random_access);
  const SampleBatch rows = test::all_rows(*source, 777);
  ASSERT_EQ(rows.size(), 2000);
  const auto names = test::attribute_names(source->info());
  const auto attribute = [&](const char* name) {
    return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
  };
  for (std::size_t i = 0; i < rows.size(); ++i) {
    // Rows are in the grid's order; the label says which one it was.
    const auto row = static_cast<std::size_t>(rows.exact[attribute("label")][i]);
    ASSERT_EQ(rows.x[i], cloud.samples.x[row]);
    ASSERT_EQ(rows.z[i], cloud.samples.z[row]);
    ASSERT_EQ(rows.radius[i], cloud.samples.radius[row]);
    ASSERT_EQ(rows.attributes[attribute("green")][i], cloud.samples.attributes[1][row]);
  }
}

TEST(VdbPoints, LevelSetsAreNone) {
  const std::string file = LAMINA_SOURCE_DIR "/../shared/data/levelset_sphere.vdb";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << file << " is absent";
  EXPECT_THAT(test::refusal(file), HasSubstr("levelset_sphere.vdb"));
}

}  // namespace
}  // namespace lamina

// What clouds are taken for, on files of every kind.
#include "lamina/normals.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <tuple>

#include "base/temporary_folder.h"
#include "points/point_rows.h"
#include "support/paths.h"

namespace lamina {
namespace {

using testing::HasSubstr;

Trade guess_of(const std::string& path) {
  return guess_trade(open_points(path)->info()).trade;
}

/// Points over 100 x 80, `high` high.
SampleBatch slab_of_points(double high) {
  SampleBatch rows;
  for (int i = 0; i < 50; ++i) {
    rows.x.push_back(i % 2 * 100);
    rows.y.push_back(i % 3 * 40);
    rows.z.push_back(i % 5 * high / 4);
  }
  return rows;
}

TEST(GuessTrade, ByWhatTheFileTells) {
  const test::TemporaryFolder folder;
  const PointColumns bare{.double_positions = true};
  const SampleBatch rows = slab_of_points(10);
  for (const char* ending : {".ply", ".xyz", ".pcd", ".las", ".laz", ".e57"}) {
    test::write_rows(folder / ("plain" + std::string(ending)), bare, rows);
    EXPECT_EQ(guess_of(folder / ("plain" + std::string(ending))), Trade::object) << ending;
  }
  PointColumns coloured = bare;
  for (const char* name : {"red", "green", "blue"}) coloured.attributes.push_back({name, ScalarType::uint8});
  test::write_rows(folder / "photos.ply", coloured, test::random_rows(coloured, 9, 1));
  EXPECT_EQ(guess_of(folder / "photos.ply"), Trade::photogrammetry);
  coloured.attributes.push_back({"intensity", ScalarType::uint16});
  test::write_rows(folder / "scan.ply", coloured, test::random_rows(coloured, 9, 1));
  EXPECT_EQ(guess_of(folder / "scan.ply"), Trade::object);
  const std::string station =
      "2\n1\n1 2 3\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n1 2 3 1\n1 2 3 0.5\n4 5 6 1\n";
  EXPECT_EQ(guess_of(test::write_file(folder / "station.ptx", station)), Trade::terrestrial);
}

TEST(GuessTrade, FromAboveIsWideAndFlatWithReturnsOrClasses) {
  const test::TemporaryFolder folder;
  const PointColumns bare{.double_positions = true};
  constexpr std::size_t kSecondReturns = 263;  // where LAS 1.4 counts them
  for (const auto& [high, expected] : {std::pair{10.0, Trade::aerial}, std::pair{90.0, Trade::object}}) {
    test::write_rows(folder / "a.las", bare, slab_of_points(high));
    std::string bytes = test::read_file(folder / "a.las");
    bytes[kSecondReturns] = 1;
    EXPECT_EQ(guess_of(test::write_file(folder / "returns.las", bytes)), expected);
    bytes[kSecondReturns] = 0;
    std::uint32_t points = 0;
    std::memcpy(&points, bytes.data() + 96, sizeof points);
    bytes[points + 16] = 2;  // one is ground
    EXPECT_EQ(guess_of(test::write_file(folder / "ground.las", bytes)), expected);
    bytes[points + 16] = 5;  // vegetation says nothing
    EXPECT_EQ(guess_of(test::write_file(folder / "tree.las", bytes)), Trade::object);
  }
}

TEST(GuessTrade, FromAboveIsAGeoreferencedHectareToo) {
  const test::TemporaryFolder folder;
  const PointColumns bare{.double_positions = true};
  for (const auto& [scale, crs, expected] :
       {std::tuple{2.0, "EPSG:32632", Trade::aerial}, std::tuple{2.0, "", Trade::object},
        std::tuple{1.0, "EPSG:32632", Trade::object}}) {
    SampleBatch rows = slab_of_points(20);
    for (double& x : rows.x) x *= scale;
    for (double& y : rows.y) y *= scale;
    test::write_rows(folder / "a.laz", bare, rows, {.crs = crs});
    EXPECT_EQ(guess_of(folder / "a.laz"), expected) << scale << crs;
  }
}

TEST(GuessTrade, RealFiles) {
  const std::string data = LAMINA_SOURCE_DIR "/../shared/data/";
  if (!std::filesystem::exists(data + "laz")) GTEST_SKIP() << data << " is absent";
  for (const char* name :
       {"laz/autzen_trim.laz", "laz/autzen_trim.las", "laz/Megaplot.laz", "laz/1.2-with-color.copc.laz"})
    EXPECT_EQ(guess_of(data + name), Trade::aerial) << name;
  EXPECT_EQ(guess_of(data + "e57/bunnyDouble.e57"), Trade::object);
  EXPECT_EQ(guess_of(data + "lone_star_utm.las"), Trade::object);
  EXPECT_EQ(guess_of(data + "lion_normals_rgb.ply"), Trade::photogrammetry);
}

TEST(GuessTrade, NormalsFaceUpInCloudsFromTheAirAndNowhereElse) {
  for (std::size_t k = 0; k < kTradeNames.size(); ++k) {
    NormalsSettings settings;
    face_by_trade(static_cast<Trade>(k), settings);
    EXPECT_EQ(settings.viewpoints.size(), static_cast<Trade>(k) == Trade::aerial ? 1 : 0) << kTradeNames[k];
  }
  NormalsSettings given;
  given.viewpoints.push_back({{1, 2, 3}, false});
  face_by_trade(Trade::aerial, given);
  EXPECT_EQ(given.viewpoints.size(), 1);
  EXPECT_THAT(describe(TradeGuess{Trade::aerial, "because"}),
              HasSubstr("taken for --preset aerial (because): normals"));
}

}  // namespace
}  // namespace lamina

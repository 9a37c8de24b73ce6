// From PLY through a scanner's format and back: exact to that format's steps. And damage of any kind, told or survived.
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "base/temporary_folder.h"
#include "points/point_rows.h"

namespace lamina {
namespace {

using test::all_rows;

PointColumns rich_columns() {
  PointColumns columns{.double_positions = true, .normals = true, .radius = "radius", .quality = "confidence"};
  columns.attributes = {{"red", ScalarType::uint16},       {"green", ScalarType::uint16}, {"blue", ScalarType::uint16},
                        {"intensity", ScalarType::uint16}, {"label", ScalarType::int32},  {"time", ScalarType::float64},
                        {"noise", ScalarType::float32}};
  return columns;
}

/// The file's points in another, under the columns that the file has.
void convert(const std::string& from, const std::string& to) {
  const auto source = open_points(from);
  const auto writer = open_points_writer(to, columns_of(source->info()), {.crs = source->info().crs});
  writer->append(all_rows(*source));
  writer->commit();
}

/// A cloud in PLY, and what became of it in another format and PLY again.
struct RoundTrip {
  explicit RoundTrip(const std::string& ending) : rows(test::random_rows(rich_columns(), 70'000, 4)) {
    test::write_rows(folder / "a.ply", rich_columns(), rows, {.crs = "PROJCS[\"grid\"]"});
    convert(folder / "a.ply", folder / ("b" + ending));
    convert(folder / ("b" + ending), folder / "c.ply");
    source = open_points(folder / "c.ply");
    back = all_rows(*source);
  }

  void expect_all_but_positions() const {
    EXPECT_EQ(source->info().crs, "PROJCS[\"grid\"]");
    EXPECT_EQ(back.nx, rows.nx);
    EXPECT_EQ(back.ny, rows.ny);
    EXPECT_EQ(back.nz, rows.nz);
    EXPECT_EQ(back.radius, rows.radius);
    for (const AttributeSpec& spec : rich_columns().attributes) {
      const auto from = find_attribute(rich_columns().attributes, spec.name);
      const auto to = find_attribute(source->info().attributes, spec.name);
      ASSERT_TRUE(from && to) << spec.name;
      EXPECT_EQ(source->info().attributes[*to].type, spec.type) << spec.name;
      EXPECT_EQ(back.attributes[*to], rows.attributes[*from]) << spec.name;
      EXPECT_EQ(back.exact[*to], rows.exact[*from]) << spec.name;
    }
  }

  test::TemporaryFolder folder;
  SampleBatch rows;
  std::unique_ptr<PointSource> source;
  SampleBatch back;
};

TEST(RoundTrips, ThroughE57EveryBitStays) {
  const RoundTrip trip(".e57");
  EXPECT_EQ(trip.back.x, trip.rows.x);
  EXPECT_EQ(trip.back.y, trip.rows.y);
  EXPECT_EQ(trip.back.z, trip.rows.z);
  EXPECT_EQ(trip.back.quality, trip.rows.quality);
  trip.expect_all_but_positions();
}

TEST(RoundTrips, ThroughLazAllButPositionsWhichAreExactToTheirStep) {
  const RoundTrip trip(".laz");
  const std::array before{&trip.rows.x, &trip.rows.y, &trip.rows.z};
  const std::array after{&trip.back.x, &trip.back.y, &trip.back.z};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto [low, high] = std::minmax_element(before[k]->begin(), before[k]->end());
    const double reach = (*high - *low) / 2 + 1;
    const double step = std::pow(10, std::ceil(std::log10(reach / 2147483647)));
    double farthest = 0;
    ASSERT_EQ(after[k]->size(), before[k]->size());
    for (std::size_t i = 0; i < before[k]->size(); ++i)
      farthest = std::max(farthest, std::abs((*after[k])[i] - (*before[k])[i]));
    EXPECT_LE(farthest, step / 2 * 1.01);
    EXPECT_GT(farthest, 0);
  }
  EXPECT_EQ(trip.back.quality, trip.rows.quality);
  trip.expect_all_but_positions();
}

/// Files that are cut short or have bits turned are refused in one line (refusal() looks at it) or read.
TEST(RoundTrips, DamageNeverCrashes) {
  const test::TemporaryFolder folder;
  const PointColumns columns = rich_columns();
  for (const char* ending : {".e57", ".laz"}) {
    const std::string path = folder / ("good" + std::string(ending));
    test::write_rows(path, columns, test::random_rows(columns, 400, 2));
    const std::string good = test::read_file(path);
    const std::string damaged = folder / ("damaged" + std::string(ending));
    std::mt19937 random(3);
    int refused = 0;
    for (int i = 0; i < 300; ++i) {
      std::string bytes = good;
      const std::size_t at = random() % bytes.size();
      if (i % 10 == 0) {
        bytes.resize(at);
      } else {
        for (int bits = 0; bits < 1 + i % 3; ++bits)
          bytes[random() % bytes.size()] ^= static_cast<char>(1U << random() % 8);
      }
      const bool believed = i % 2 == 0;  // pages of E57 with wrong checksums, too
      const std::string said =
          test::refusal(test::write_file(damaged, bytes), PointSettings{.ignore_checksums = believed});
      refused += said.empty() ? 0 : 1;
      if (std::string_view(ending) == ".e57" && !believed) {
        EXPECT_NE(said, "") << "changed bytes that no checksum covers";
      }
    }
    EXPECT_GT(refused, 30) << ending;
  }
}

}  // namespace
}  // namespace lamina

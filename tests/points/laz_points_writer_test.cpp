// LAZ as it is written, read again.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <random>
#include <string>

#include "lamina/points.h"
#include "laz/chunks.h"
#include "points/formats.h"
#include "points/las.h"
#include "points/laz_files.h"
#include "points/point_rows.h"
#include "support/paths.h"

namespace lamina::test {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

class LazPointsWriter : public LazFolder {};

TEST_F(LazPointsWriter, AnyRecordsCanBeEncoded) {
  // Records that LASzip wrote: all fields on a random walk, four channels of a scanner, extra bytes; and those whose
  // every byte is by chance.
  const auto expect_same = [](const laz::RecordLayout& layout, const std::string& records, const std::string& what) {
    for (const std::size_t count : {records.size() / layout.bytes, std::size_t{2}, std::size_t{1}}) {
      const auto* const bytes = reinterpret_cast<const std::byte*>(records.data());
      const std::vector<std::byte> chunk = laz::encode_layered(layout, bytes, count);
      std::string back(count * layout.bytes, '\0');
      laz::decode_layered(layout, chunk, {}, count, reinterpret_cast<std::byte*>(back.data()));
      ASSERT_TRUE(records.compare(0, back.size(), back) == 0) << what << ", " << count;
    }
  };
  std::mt19937 random(3);
  for (const char* name : {"f6_c4", "f7_x3", "f8_c4_x2"}) {
    const Opened las(las_of(name));
    const int format = las.header.point_format;
    laz::RecordLayout layout{.bytes = las.header.record_bytes,
                             .extra_bytes = las.header.record_bytes - las_record_bytes(format),
                             .gps_time = true,
                             .colours = format >= 7,
                             .infrared = format == 8};
    std::string records = las.all();
    for (const bool apart : {false, true}) {
      layout.channels_apart = apart;
      expect_same(layout, records, name);
    }
    // As large as that of the same points in LASzip's own file, but for choices an encoder is free in.
    if (format == 6) {
      const auto* const bytes = reinterpret_cast<const std::byte*>(records.data());
      const std::size_t own = laz::encode_layered(layout, bytes, records.size() / layout.bytes).size();
      EXPECT_LT(static_cast<double>(own),
                1.02 * static_cast<double>(std::filesystem::file_size(kLazFolder + name + ".laz")));
    }
    for (char& c : records) c = static_cast<char>(random());
    expect_same(layout, records, std::string(name) + " by chance");
  }
}

TEST_F(LazPointsWriter, FieldsOfRecordsAreWrittenAgain) {
  const PointSettings all{.all_fields = true, .select = {.drop_classes = {}}};
  for (const std::string name : {"f3_x3", "f6_c4", "f7_x3", "f8_c4_x2"}) {
    const auto source = open_points(las_of(name), all);
    std::vector<std::string> names;
    for (const AttributeSpec& a : source->info().attributes) names.push_back(a.name);
    EXPECT_THAT(names,
                testing::IsSupersetOf({"return_number", "number_of_returns", "classification", "class_flags",
                                       "scan_direction", "scan_angle", "user_data", "point_source", "gps_time"}));
    const SampleBatch rows = all_rows(*source);
    for (const char* ending : {".las", ".laz"}) {
      const std::string path = folder_ / ("again" + std::string(ending));
      write_rows(path, columns_of(source->info()), rows);
      const auto again = open_points(path, all);
      const SampleBatch back = all_rows(*again);
      ASSERT_EQ(back.size(), rows.size());
      for (const AttributeSpec& a : source->info().attributes) {
        const auto& list = again->info().attributes;
        const auto place =
            std::find_if(list.begin(), list.end(), [&](const AttributeSpec& b) { return b.name == a.name; });
        ASSERT_NE(place, list.end()) << a.name;
        // Angles were whole degrees in older formats; newer ones have finer steps.
        if (a.type != ScalarType::int8) {
          EXPECT_EQ(place->type, a.type) << a.name;
        }
        const auto i = static_cast<std::size_t>(&a - source->info().attributes.data());
        const auto j = static_cast<std::size_t>(place - list.begin());
        if (a.name == "scan_angle") {
          for (std::size_t k = 0; k < rows.size(); ++k)
            ASSERT_NEAR(back.attributes[j][k], rows.attributes[i][k], 0.003);
        } else {
          EXPECT_TRUE(back.attributes[j] == rows.attributes[i] && back.exact[j] == rows.exact[i]) << name << a.name;
        }
      }
      // And the selection still knows them.
      PointSettings ground;
      ground.select.keep_classes = {2};
      ground.select.returns = PointSelection::Returns::last;
      EXPECT_EQ(all_rows(path, ground).size(), all_rows(las_of(name), ground).size());
    }
  }
}

TEST_F(LazPointsWriter, FieldsThatNoRecordHasRoomForAreRefused) {
  const PointColumns columns{.attributes = {{"classification", ScalarType::float32}}};
  for (const float value : {256.0F, -1.0F, 2.5F}) {
    SampleBatch rows;
    rows.x = rows.y = rows.z = {1};
    rows.attributes = {{value}};
    rows.exact.resize(1);
    try {
      write_rows(folder_ / "a.laz", columns, rows);
      ADD_FAILURE() << value;
    } catch (const Error& e) {
      EXPECT_THAT(e.what(), HasSubstr("a.laz: LAS has room for a classification of 0 to 255 without a fraction"));
    }
    EXPECT_EQ(folder_.entries(), 0);
  }
}

TEST_F(LazPointsWriter, WrittenAsTheRecordsOfLas) {
  PointColumns columns{.double_positions = true, .normals = true, .radius = "radius"};
  columns.attributes = {{"intensity", ScalarType::uint16}, {"label", ScalarType::int32}};
  PointColumns coloured = columns;
  for (const char* name : {"red", "green", "blue"}) coloured.attributes.push_back({name, ScalarType::uint8});
  const std::string crs = "PROJCS[\"somewhere / zone 3\",GEOGCS[\"globe\"]]";
  for (const PointColumns& c : {PointColumns{.double_positions = true}, columns, coloured}) {
    for (const std::size_t n : {0U, 1U, 2U, 50'000U, 50'001U, 130'007U}) {
      SCOPED_TRACE(fmt::format("{} rows, {} attributes", n, c.attributes.size()));
      const SampleBatch rows = random_rows(c, n, 3);
      const std::string las = folder_ / "a.las";
      const std::string laz = folder_ / "a.laz";
      for (const std::string& path : {las, laz}) {
        const auto writer = open_points_writer(path, c, {.crs = crs});
        writer->append(rows);
        writer->commit();
      }
      const Opened written(laz);
      EXPECT_EQ(written.header.point_format, c.attributes.size() > 2 ? 7 : 6);
      EXPECT_EQ(written.header.crs, crs);
      EXPECT_THAT(written.records->remarks(), IsEmpty());
      EXPECT_EQ(written.records->count(), n);
      EXPECT_TRUE(written.all() == Opened(las).all());
    }
  }
}

TEST_F(LazPointsWriter, TheCoordinateSystemGoesAlong) {
  const std::string crs = "COMPD_CS[\"town grid + heights\",PROJCS[\"town grid\"]]";
  const std::string laz = folder_ / "a.laz";
  const SampleBatch rows = random_rows({.double_positions = true}, 10, 3);
  for (const char* name : {"a.laz", "a.las", "a.ply"}) {
    const std::string path = folder_ / name;
    const auto writer = open_points_writer(path, {.double_positions = true}, {.crs = crs});
    writer->append(rows);
    writer->commit();
    const auto source = open_points(path);
    EXPECT_EQ(source->info().crs, crs);
    EXPECT_EQ(crs_name(source->info().crs), "town grid + heights");
  }
  EXPECT_EQ(crs_name("EPSG:32616"), "EPSG:32616");
  const auto joined = open_points({laz, las_of("f0"), folder_ / "a.ply"}, PointSettings{});
  EXPECT_EQ(joined->info().crs, crs);
}

}  // namespace
}  // namespace lamina::test

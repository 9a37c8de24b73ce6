// LAS of every version and point format, written field by field from the specification's tables, and files that lie.
#include "points/formats.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <random>

#include "base/temporary_folder.h"
#include "points/point_rows.h"
#include "support/paths.h"

namespace lamina {
namespace {

using test::all_rows;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

template <class T>
void put(std::string& bytes, T value) {
  char raw[sizeof value];
  std::memcpy(raw, &value, sizeof value);
  bytes.append(raw, sizeof value);
}

template <class T>
void put_at(std::string& bytes, std::size_t at, T value) {
  std::memcpy(bytes.data() + at, &value, sizeof value);
}

struct LasPoint {
  std::int32_t x, y, z;
  std::uint16_t intensity, red, green, blue, nir;
};

struct LasFile {
  int minor = 2;
  int format = 3;
  std::vector<LasPoint> points{};
  std::string extra{};    ///< behind every point
  std::string records{};  ///< variable length ones
  std::uint32_t record_count = 0;
  double scale[3] = {0.001, 0.002, 0.01}, offset[3] = {500'000, 4'000'000.5, -100};
};

std::string point_bytes(const LasFile& file, const LasPoint& p) {
  std::string b;
  for (const std::int32_t v : {p.x, p.y, p.z}) put(b, v);
  put(b, p.intensity);
  const bool modern = file.format >= 6;
  b += std::string(modern ? 8 : 6, '\x11');  // returns, class, angle, user data, source
  if (modern || file.format == 1 || file.format >= 3) put(b, 1234.5);
  if (file.format == 2 || file.format == 3 || file.format == 5 || file.format == 7 || file.format == 8 ||
      file.format == 10) {
    for (const std::uint16_t v : {p.red, p.green, p.blue}) put(b, v);
  }
  if (file.format == 8 || file.format == 10) put(b, p.nir);
  if (file.format == 4 || file.format == 5 || file.format >= 9) b += std::string(29, '\x22');  // wave packet
  return b + file.extra;
}

std::string las_bytes(const LasFile& file) {
  const std::size_t header = file.minor >= 4 ? 375 : file.minor == 3 ? 235 : 227;
  std::string b(header, '\0');
  b.replace(0, 4, "LASF");
  b[24] = 1;
  b[25] = static_cast<char>(file.minor);
  put_at(b, 94, static_cast<std::uint16_t>(header));
  put_at(b, 96, static_cast<std::uint32_t>(header + file.records.size()));
  put_at(b, 100, file.record_count);
  b[104] = static_cast<char>(file.format);
  put_at(b, 105, static_cast<std::uint16_t>(point_bytes(file, {}).size()));
  if (file.format < 6) put_at(b, 107, static_cast<std::uint32_t>(file.points.size()));
  for (std::size_t k = 0; k < 3; ++k) {
    put_at(b, 131 + 8 * k, file.scale[k]);
    put_at(b, 155 + 8 * k, file.offset[k]);
  }
  if (file.minor >= 4) put_at(b, 247, static_cast<std::uint64_t>(file.points.size()));
  b += file.records;
  for (const LasPoint& p : file.points) b += point_bytes(file, p);
  return b;
}

std::string variable_record(const std::string& user, std::uint16_t id, const std::string& data) {
  std::string b(54, '\0');
  b.replace(2, user.size(), user);
  put_at(b, 18, id);
  put_at(b, 20, static_cast<std::uint16_t>(data.size()));
  return b + data;
}

std::vector<LasPoint> random_points(std::size_t n, unsigned brightest) {
  std::mt19937 random(9);
  std::vector<LasPoint> points(n);
  for (LasPoint& p : points) {
    const auto colour = [&] { return static_cast<std::uint16_t>(random() % (brightest + 1)); };
    p = {static_cast<std::int32_t>(random()),
         static_cast<std::int32_t>(random()),
         static_cast<std::int32_t>(random()),
         static_cast<std::uint16_t>(random() % 65536),
         colour(),
         colour(),
         colour(),
         colour()};
  }
  return points;
}

class LasPoints : public ::testing::Test {
 protected:
  std::unique_ptr<PointSource> open(const LasFile& file) const { return open_points(write(las_bytes(file))); }
  std::string write(const std::string& bytes) const { return test::write_file(folder_ / "cloud.las", bytes); }
  test::TemporaryFolder folder_;
};

TEST_F(LasPoints, EveryVersionAndPointFormat) {
  const std::vector<LasPoint> points = random_points(3000, 65535);
  for (int minor = 0; minor <= 4; ++minor) {
    for (int format = 0; format <= (minor >= 4 ? 10 : minor == 3 ? 5 : 3); ++format) {
      SCOPED_TRACE(fmt::format("1.{} format {}", minor, format));
      const LasFile file{.minor = minor, .format = format, .points = points};
      const auto source = open(file);
      const PointSourceInfo& info = source->info();
      EXPECT_EQ(info.count, points.size());
      EXPECT_TRUE(info.double_precision && info.random_access && !info.has_normals && !info.geographic);
      const bool colours = format == 2 || format == 3 || format == 5 || format == 7 || format == 8 || format == 10;
      const bool nir = format == 8 || format == 10;
      AttributeLayout layout{{"intensity", ScalarType::uint16}};
      for (const char* name : {"red", "green", "blue"}) {
        if (colours) layout.push_back({name, ScalarType::uint16});
      }
      if (nir) layout.push_back({"nir", ScalarType::uint16});
      ASSERT_EQ(info.attributes, layout);
      const SampleBatch rows = all_rows(*source, 1111);
      for (std::size_t i = 0; i < points.size(); ++i) {
        ASSERT_EQ(rows.x[i], points[i].x * file.scale[0] + file.offset[0]);
        ASSERT_EQ(rows.y[i], points[i].y * file.scale[1] + file.offset[1]);
        ASSERT_EQ(rows.z[i], points[i].z * file.scale[2] + file.offset[2]);
        ASSERT_EQ(rows.attributes[0][i], points[i].intensity);
        if (colours) {
          ASSERT_EQ(rows.attributes[1][i], points[i].red);
          ASSERT_EQ(rows.attributes[3][i], points[i].blue);
        }
        if (nir) {
          ASSERT_EQ(rows.attributes[4][i], points[i].nir);
        }
      }
    }
  }
}

TEST_F(LasPoints, EightBitColoursAreToldFromSixteen) {
  LasFile file{.points = random_points(40'000, 255)};
  const auto eight = open(file);
  EXPECT_EQ(eight->info().attributes[1], (AttributeSpec{"red", ScalarType::uint8}));
  EXPECT_THAT(eight->info().remarks, ElementsAre(HasSubstr("8-bit colours")));
  EXPECT_EQ(all_rows(*eight).attributes[1][7], file.points[7].red);
  file.points[39'999].green = 256;  // a single one decides, wherever it is
  EXPECT_EQ(open(file)->info().attributes[1], (AttributeSpec{"red", ScalarType::uint16}));
}

TEST_F(LasPoints, ValuesThatNoPointHasAreNoAttributes) {
  LasFile file{.points = random_points(100, 0)};
  for (LasPoint& p : file.points) p.intensity = 0;
  EXPECT_THAT(open(file)->info().attributes, IsEmpty());
  file.points[99].blue = 3;
  EXPECT_THAT(test::attribute_names(open(file)->info()), ElementsAre("red", "green", "blue"));
}

TEST_F(LasPoints, ExtraBytesAreNormalsAndWhateverElse) {
  std::string descriptors;
  const auto describe = [&](const std::string& name, int type, int options, double scale, double shift) {
    std::string d(192, '\0');
    d[2] = static_cast<char>(type);
    d[3] = static_cast<char>(options);
    d.replace(4, name.size(), name);
    put_at(d, 112, scale);
    put_at(d, 136, shift);
    descriptors += d;
  };
  LasFile file{.minor = 4, .format = 7, .points = random_points(50, 65535)};
  describe("NormalX", 9, 0, 9, 9);
  describe("NormalY", 9, 0, 9, 9);
  describe("pair", 23, 0, 0, 0);  // three 16-bit values: passed over
  describe("NormalZ", 10, 0, 9, 9);
  describe("Deviation", 4, 24, 0.5, 10);
  describe("id", 5, 0, 0, 0);
  put(file.extra, 0.25F);
  put(file.extra, 0.5F);
  file.extra += "123456";
  put(file.extra, 0.75);
  put(file.extra, std::int16_t{-7});
  put(file.extra, std::uint32_t{4'000'000'001});
  file.records = variable_record("other", 9, "data") + variable_record("LASF_Spec", 4, descriptors);
  file.record_count = 2;
  const auto source = open(file);
  EXPECT_TRUE(source->info().has_normals);
  const SampleBatch rows = all_rows(*source);
  EXPECT_EQ(rows.nx[3], 0.25F);
  EXPECT_EQ(rows.ny[3], 0.5F);
  EXPECT_EQ(rows.nz[3], 0.75F);
  ASSERT_EQ(source->info().attributes.size(), 6);
  EXPECT_EQ(source->info().attributes[4], (AttributeSpec{"deviation", ScalarType::float32}));
  EXPECT_EQ(rows.attributes[4][3], 6.5F);
  EXPECT_EQ(rows.exact[5][3], 4'000'000'001);
}

TEST_F(LasPoints, DegreesAreTold) {
  LasFile file{.points = random_points(5, 65535)};
  const auto geographic_with = [&](const std::string& user, std::uint16_t id, const std::string& data) {
    file.records = variable_record(user, id, data);
    file.record_count = 1;
    return open(file)->info().geographic;
  };
  const auto keys = [](std::uint16_t model) {
    std::string k;
    for (const int v : {1, 1, 0, 2, 1025, 0, 1, 1, 1024, 0, 1}) put(k, static_cast<std::uint16_t>(v));
    put(k, model);
    return k;
  };
  EXPECT_FALSE(geographic_with("LASF_Projection", 34735, keys(1)));
  std::string numbered = keys(1);
  for (const int v : {3072, 0, 1, 32616}) put(numbered, static_cast<std::uint16_t>(v));
  EXPECT_FALSE(geographic_with("LASF_Projection", 34735, numbered));
  EXPECT_EQ(open(file)->info().crs, "EPSG:32616");
  EXPECT_TRUE(geographic_with("LASF_Projection", 34735, keys(2)));
  EXPECT_FALSE(geographic_with("LASF_Projection", 34735, keys(3)));  // geocentric metres
  EXPECT_FALSE(geographic_with("somebody", 34735, keys(2)));
  EXPECT_TRUE(geographic_with("LASF_Projection", 2112, "GEOGCS[\"WGS 84\",DATUM[]]"));
  EXPECT_TRUE(geographic_with("LASF_Projection", 2112, "COMPD_CS[\"a\",GEOGCS[\"b\"],VERT_CS[]]"));
  EXPECT_FALSE(geographic_with("LASF_Projection", 2112, "PROJCS[\"UTM\",GEOGCS[\"WGS 84\"]]"));
  // Without any word about it, by steps that only degrees have.
  file = {.points = random_points(5, 65535), .scale = {1e-7, 1e-7, 0.01}, .offset = {0, 0, 0}};
  EXPECT_TRUE(open(file)->info().geographic);
  file.scale[2] = 1e-7;  // a small thing measured finely
  EXPECT_FALSE(open(file)->info().geographic);
}

TEST_F(LasPoints, HeadersThatLie) {
  const LasFile file{.minor = 4, .format = 7, .points = random_points(30, 65535)};
  const std::string good = las_bytes(file);
  const auto with = [&](std::size_t at, auto value) {
    std::string bytes = good;
    put_at(bytes, at, value);
    return test::refusal(write(bytes));
  };
  EXPECT_EQ(test::refusal(write(good)), "");
  EXPECT_THAT(with(25, char{7}), HasSubstr("LAS version 1.7 is not supported"));
  EXPECT_THAT(with(94, std::uint16_t{200}), HasSubstr("the LAS header says it has 200 bytes"));
  EXPECT_THAT(with(96, std::uint32_t{100}), HasSubstr("points begin at byte 100, which is inside the header"));
  EXPECT_THAT(with(96, std::uint32_t{4'000'000'000}), HasSubstr("behind the end of the file"));
  EXPECT_THAT(with(104, char{11}), HasSubstr("point format 11"));
  EXPECT_THAT(with(105, std::uint16_t{35}), HasSubstr("points have 35 bytes (at byte 105), format 7 needs 36"));
  EXPECT_THAT(with(131, 0.0), HasSubstr("make no coordinates"));
  EXPECT_THAT(with(155, std::nan("")), HasSubstr("make no coordinates"));
  EXPECT_THAT(with(247, std::uint64_t{31}), HasSubstr("the header promises 31 points, the file holds 30"));
  EXPECT_THAT(with(247, ~std::uint64_t{0}), HasSubstr("the file holds 30"));
  EXPECT_EQ(with(100, ~std::uint32_t{0}), "");  // records that are not there matter to no point
  for (std::size_t size = 4; size < good.size(); size += 5)
    EXPECT_NE(test::refusal(write(good.substr(0, size))), "") << size;
}

/// A record behind the points, which may be longer than those before.
std::string extended_record(const std::string& user, std::uint16_t id, const std::string& data) {
  std::string b(60, '\0');
  b.replace(2, user.size(), user);
  put_at(b, 18, id);
  put_at(b, 20, static_cast<std::uint64_t>(data.size()));
  return b + data;
}

TEST_F(LasPoints, RecordsBehindThePoints) {
  const LasFile file{.minor = 4, .format = 6, .points = random_points(30, 65535)};
  const std::string good = las_bytes(file);
  const auto with = [&](const std::string& records, std::uint32_t count, std::uint64_t begin) {
    std::string bytes = good;
    put_at(bytes, 235, begin);
    put_at(bytes, 243, count);
    return open_points(write(bytes + records));
  };
  const std::string text = extended_record("LASF_Projection", 2112, "GEOGCS[\"WGS 84\",DATUM[]]");
  const auto geographic = with(extended_record("other", 7, std::string(70'000, 'x')) + text, 2, good.size());
  EXPECT_TRUE(geographic->info().geographic);
  EXPECT_THAT(geographic->info().remarks, IsEmpty());
  EXPECT_EQ(all_rows(*geographic).size(), 30U);
  // Those that lie: begin nowhere, go on without end, are longer than the file. Points do not depend on them.
  std::string endless = text;
  put_at(endless, 20, ~std::uint64_t{0});
  for (const auto& source : {with(text, 1, ~std::uint64_t{0}), with(text, 1, 3), with(endless, 1, good.size()),
                             with(endless, ~std::uint32_t{0}, good.size())}) {
    EXPECT_FALSE(source->info().geographic);
    EXPECT_EQ(all_rows(*source).size(), 30U);
  }
  EXPECT_TRUE(with(text, ~std::uint32_t{0}, good.size())->info().geographic);
}

TEST_F(LasPoints, CountsOfBothGenerations) {
  // 1.4 keeps the old count for old formats, or 0 where it does not fit; the wide one decides where there is one.
  const LasFile file{.minor = 4, .format = 3, .points = random_points(30, 65535)};
  const auto counted = [&](std::uint32_t narrow, std::uint64_t wide) {
    std::string bytes = las_bytes(file);
    put_at(bytes, 107, narrow);
    put_at(bytes, 247, wide);
    return open_points(write(bytes));
  };
  for (const auto& [narrow, wide] : {std::pair{30U, 30U}, std::pair{0U, 30U}, std::pair{30U, 0U}, std::pair{7U, 30U}}) {
    const auto source = counted(narrow, wide);
    EXPECT_EQ(source->info().count, 30U);
    EXPECT_THAT(source->info().remarks, IsEmpty());
  }
  const auto fewer = counted(30, 28);
  EXPECT_EQ(fewer->info().count, 28U);
  EXPECT_THAT(fewer->info().remarks, ElementsAre(HasSubstr("counts 28 points; behind them is room for 2 more")));
}

TEST_F(LasPoints, NoPointsAndThoseThatWereNeverCounted) {
  for (const int minor : {0, 2, 3, 4}) {
    SCOPED_TRACE(minor);
    const LasFile none{.minor = minor, .format = minor == 4 ? 6 : 1};
    EXPECT_EQ(open(none)->info().count, 0U);
    EXPECT_EQ(all_rows(*open(none)).size(), 0U);
    LasFile file = none;
    file.points = random_points(30, 65535);
    std::string bytes = las_bytes(file);
    put_at(bytes, 107, std::uint32_t{0});
    if (minor == 4) put_at(bytes, 247, std::uint64_t{0});
    EXPECT_THAT(test::refusal(write(bytes)), HasSubstr("counts no points"));
    EXPECT_THAT(test::refusal(write(bytes)), HasSubstr("there is room for 30"));
  }
  // Wave packets lie behind the points, too.
  std::string waves = las_bytes({.minor = 3, .format = 4, .points = random_points(30, 65535)});
  put_at(waves, 227, static_cast<std::uint64_t>(waves.size()));
  EXPECT_THAT(open_points(write(waves + std::string(5000, 'w')))->info().remarks, IsEmpty());
}

TEST_F(LasPoints, RealFiles) {
  const std::string folder = LAMINA_SOURCE_DIR "/../shared/data/";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is absent";
  const auto outcrop = open_points(folder + "outcrop_rgb_utm.las");
  EXPECT_EQ(outcrop->info().count, 268'035);
  EXPECT_EQ(outcrop->info().attributes[0], (AttributeSpec{"red", ScalarType::uint16}));
  const SampleBatch rows = all_rows(*outcrop);
  const auto [low, high] = std::minmax_element(rows.y.begin(), rows.y.end());
  EXPECT_NEAR(*low, 6010935.736022949, 1e-6);
  EXPECT_NEAR(*high, 6010946.562011719, 1e-6);
  EXPECT_EQ(open_points(folder + "lone_star_utm.las")->info().count, 518'862);
  EXPECT_TRUE(open_points(folder + "las/epsg_4326.las")->info().geographic);
  EXPECT_EQ(open_points(folder + "las/autzen_trim_7.las")->info().attributes[1].type, ScalarType::uint8);
}

}  // namespace
}  // namespace lamina

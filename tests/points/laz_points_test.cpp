// LAZ against the LAS it was made of, byte by byte: files of LASzip's own (tests/points/laz, every value of a random
// walk) and of other programs; files without their chunk table, damaged ones, and those that lie.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <set>

#include "base/temporary_folder.h"
#include "lamina/points.h"
#include "laz/chunks.h"
#include "points/formats.h"
#include "points/las.h"
#include "points/laz_files.h"
#include "points/point_rows.h"
#include "support/paths.h"

namespace lamina {
namespace {

using test::all_rows;
using test::kLazFolder;
using test::kPairs;
using test::las_of;
using test::laz_bytes;
using test::Opened;

using testing::AnyOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class LazPoints : public test::LazFolder {};

template <class T>
void patch(std::string& bytes, std::size_t at, T value) {
  std::memcpy(bytes.data() + at, &value, sizeof value);
}

template <class T>
T stored_at(const std::string& bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

TEST_F(LazPoints, EveryValueOfEveryFormat) {
  for (const std::string name : kPairs) {
    SCOPED_TRACE(name);
    const Opened las(las_of(name));
    const Opened laz(kLazFolder + name + ".laz");
    ASSERT_TRUE(laz.header.packing && !las.header.packing);
    EXPECT_EQ(laz.records->count(), las.records->count());
    EXPECT_THAT(laz.records->remarks(), IsEmpty());
    EXPECT_TRUE(laz.all() == las.all());
  }
}

TEST_F(LazPoints, AnyRowsFromAnyThread) {
  for (const std::string name : kPairs) {
    SCOPED_TRACE(name);
    const Opened las(las_of(name));
    const Opened laz(kLazFolder + name + ".laz");
    const std::uint64_t count = las.records->count();
    tbb::parallel_for(0, 200, [&](int i) {
      std::mt19937 random(static_cast<unsigned>(i));
      const std::uint64_t first = random() % count;
      const std::size_t n = random() % (count - first + 1);
      EXPECT_TRUE(laz.read(first, n) == las.read(first, n)) << first << " " << n;
    });
  }
}

TEST_F(LazPoints, LayersNobodyWantsChangeNoOther) {
  for (const std::string name : {"f7_x3", "f8_c4_x2"}) {
    SCOPED_TRACE(name);
    const Opened las(las_of(name));
    const Opened laz(kLazFolder + name + ".laz");
    const auto count = static_cast<std::size_t>(las.records->count());
    const std::size_t stride = las.header.record_bytes;
    const std::string truth = las.all();
    for (std::size_t byte = 0; byte < stride; ++byte) {
      laz::WantedBytes wanted(stride, false);
      wanted[byte] = true;
      const std::string read = laz.read(0, count, wanted);
      for (std::size_t i = 0; i < count; ++i) ASSERT_EQ(read[i * stride + byte], truth[i * stride + byte]) << byte;
    }
  }
}

TEST_F(LazPoints, AreTheRowsOfLas) {
  const auto las = open_points(las_of("f7_x3"));
  const auto laz = open_points(kLazFolder + "f7_x3.laz");
  EXPECT_EQ(laz->info().attributes, las->info().attributes);
  EXPECT_TRUE(laz->info().random_access && laz->info().double_precision);
  const SampleBatch a = all_rows(*las);
  const SampleBatch b = all_rows(*laz, 77);
  EXPECT_EQ(a.x, b.x);
  EXPECT_EQ(a.z, b.z);
  EXPECT_EQ(a.attributes, b.attributes);
}

TEST_F(LazPoints, WithoutAChunkTable) {
  for (const std::string name : kPairs) {
    SCOPED_TRACE(name);
    const std::string good = laz_bytes(kLazFolder + name + ".laz");
    const std::string truth = Opened(las_of(name)).all();
    const auto data = stored_at<std::uint32_t>(good, 96);
    const auto table = stored_at<std::uint64_t>(good, data);
    // A writer to a stream says -1 first, and at the end where the table is.
    std::string streamed = good;
    patch(streamed, data, ~std::uint64_t{0});
    streamed.append(reinterpret_cast<const char*>(&table), sizeof table);
    const Opened found(write(streamed));
    EXPECT_THAT(found.records->remarks(), IsEmpty());
    EXPECT_TRUE(found.all() == truth);
    // A writer that was stopped leaves none; or it is damaged.
    std::string stopped = good.substr(0, table);
    patch(stopped, data, static_cast<std::uint64_t>(data));
    std::string damaged = good;
    patch(damaged, table + 4, std::uint32_t{0xFFFFFFF0});
    for (const std::string& bytes : {stopped, damaged}) {
      const Opened walked(write(bytes));
      EXPECT_THAT(walked.records->remarks(), ElementsAre(HasSubstr("the chunk table is missing")));
      EXPECT_TRUE(walked.all() == truth);
    }
    EXPECT_THAT(test::refusal(write(stopped.substr(0, stopped.size() - 100))),
                HasSubstr("are found; the chunk at byte"));
  }
}

TEST_F(LazPoints, DamageIsRefusedOrReadButNeverCrashes) {
  for (const std::string name : {"f3_x3", "f8_c4_x2"}) {
    SCOPED_TRACE(name);
    const std::string good = laz_bytes(kLazFolder + name + ".laz");
    // Behind the last chunk only its table is lost, which is not needed.
    const auto table = stored_at<std::uint64_t>(good, stored_at<std::uint32_t>(good, 96));
    for (std::size_t size = 4; size < table; size += 61) {
      EXPECT_NE(test::refusal(write(good.substr(0, size))), "") << size;
    }
    std::mt19937 random(5);
    const auto data = stored_at<std::uint32_t>(good, 96) + 8U;
    std::size_t told = 0;
    constexpr std::size_t kFlips = 300;
    for (std::size_t i = 0; i < kFlips; ++i) {
      std::string bytes = good;
      const std::size_t at = data + random() % (good.size() - data);
      bytes[at] = static_cast<char>(bytes[at] ^ (1 << random() % 8));
      told += test::refusal(write(bytes)).empty() ? 0 : 1;
    }
    EXPECT_GT(told, kFlips / 2);  // there are no checksums
  }
}

TEST_F(LazPoints, HeadersThatLie) {
  const std::string good = laz_bytes(kLazFolder + "f7_x3.laz");
  const auto with = [&](std::size_t at, auto value) {
    std::string bytes = good;
    patch(bytes, at, value);
    return test::refusal(write(bytes));
  };
  const std::size_t record = 375 + 54;  // LASzip's is the only one
  EXPECT_EQ(test::refusal(write(good)), "");
  std::string waves = good;
  patch(waves, 104, static_cast<char>(0x80 | 10));
  patch(waves, 105, std::uint16_t{67});
  EXPECT_THAT(test::refusal(write(waves)), HasSubstr("format 10 (wave packets) are not read"));
  EXPECT_THAT(with(104, static_cast<char>(0x80 | 3)), HasSubstr("compressed by method 3.0, which is not known"));
  EXPECT_THAT(with(100, std::uint32_t{0}),
              HasSubstr("'laszip encoded', which says how points are compressed, is missing"));
  EXPECT_THAT(with(record + 2, std::uint16_t{7}), HasSubstr("method 3.7"));
  EXPECT_THAT(with(record + 32, std::uint16_t{2}), HasSubstr("have 3 compressed items, not 2"));
  EXPECT_THAT(with(record + 34, std::uint16_t{6}), HasSubstr("item 0 of the points is of kind 6 and 30 bytes"));
  EXPECT_THAT(with(record + 38, std::uint16_t{9}), HasSubstr("item 0 of the points is of version 9"));
  std::string old = laz_bytes(kLazFolder + "f0.laz");
  const std::size_t name = old.find("laszip encoded");
  patch(old, name - 2 + 54 + 38, std::uint16_t{1});
  EXPECT_THAT(test::refusal(write(old)), HasSubstr("as LASzip did before 2011; compress them anew: laszip -i FILE"));
  EXPECT_THAT(with(247, std::uint64_t{5000}), HasSubstr("the header promises 5000 points, the chunk table has"));
  EXPECT_THAT(with(247, ~std::uint64_t{0}), HasSubstr("compressed bytes are too few"));
  EXPECT_THAT(with(247, std::uint64_t{0}), HasSubstr("counts no points, but compressed ones follow"));
  EXPECT_THAT(with(record + 12, std::uint32_t{1'000'000}), HasSubstr("is damaged: it says it holds another number"));
}

TEST_F(LazPoints, FewerPointsThanThereAre) {
  std::string bytes = laz_bytes(kLazFolder + "f7_x3.laz");
  const auto count = stored_at<std::uint64_t>(bytes, 247);
  patch(bytes, 247, std::uint64_t{100});
  const Opened fewer(write(bytes));
  EXPECT_EQ(fewer.records->count(), 100U);
  EXPECT_THAT(fewer.records->remarks(), ElementsAre(HasSubstr("the header counts 100 points")));
  EXPECT_GT(count, 100U);
  EXPECT_TRUE(fewer.all() == Opened(las_of("f7_x3")).read(0, 100));
}

TEST_F(LazPoints, NodesOfCopc) {
  const std::string path = LAMINA_SOURCE_DIR "/../shared/data/laz/1.2-with-color.copc.laz";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is absent";
  const auto points_of = [&](const PointSelection& selection) {
    const SampleBatch rows = all_rows(path, {.select = selection});
    std::multiset<std::array<double, 3>> points;
    for (std::size_t i = 0; i < rows.size(); ++i) points.insert({rows.x[i], rows.y[i], rows.z[i]});
    return points;
  };
  const auto all = points_of({});
  EXPECT_EQ(all.size(), 1065U);
  EXPECT_EQ(points_of({.resolution = 1e-9}), all);
  std::size_t fewer = 0;
  for (double resolution = 4096; resolution > 1; resolution /= 2) {
    const auto coarse = points_of({.resolution = resolution});
    EXPECT_GE(coarse.size(), fewer);
    EXPECT_TRUE(std::includes(all.begin(), all.end(), coarse.begin(), coarse.end()));
    fewer = coarse.size();
  }
  EXPECT_GT(fewer, points_of({.resolution = 4096}).size());
  const std::array<std::array<double, 3>, 2> box{{{636000, 849000, 0}, {636500, 849500, 1000}}};
  const auto near = points_of({.box = box});
  EXPECT_LT(near.size(), all.size());
  for (const auto& p : all) {
    const bool inside = p[0] >= box[0][0] && p[0] <= box[1][0] && p[1] >= box[0][1] && p[1] <= box[1][1];
    EXPECT_TRUE(!inside || near.contains(p));
  }
}

TEST_F(LazPoints, PairsOfOtherPrograms) {
  const std::string folder = LAMINA_SOURCE_DIR "/../shared/data/laz/";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is absent";
  int pairs = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string laz = entry.path().string();
    if (!laz.ends_with(".laz")) continue;
    SCOPED_TRACE(laz);
    const std::string bare = laz.substr(0, laz.size() - 4);
    const std::string las = bare.ends_with(".las") ? bare : bare + ".las";
    const Opened opened(laz);
    const std::string records = opened.all();
    if (!std::filesystem::exists(las)) continue;
    EXPECT_TRUE(records == Opened(las).all());
    ++pairs;
  }
  EXPECT_GE(pairs, 8);
}

}  // namespace
}  // namespace lamina

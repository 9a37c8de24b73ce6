// PCD in its three encodings from one table of values, an independent LZF packer, and headers that lie.
#include "points/formats.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <random>

#include "base/temporary_folder.h"
#include "points/input_file.h"
#include "points/point_rows.h"

namespace lamina {
namespace {

using test::all_rows;
using testing::ElementsAre;
using testing::HasSubstr;

struct Point {
  float x, y, z;
  std::uint32_t rgb;
  float nx, ny, nz;
  std::int16_t ring;
  double time;
};

std::string raw(const auto& value) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}

std::vector<Point> random_pcd_points(std::size_t n, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  std::vector<Point> points(n);
  for (Point& p : points) {
    p = {normal(random),      normal(random), normal(random), static_cast<std::uint32_t>(random() & 0xFFFFFFU),
         normal(random),      normal(random), normal(random), static_cast<std::int16_t>(random() % 100 - 50),
         1e9 + normal(random)};
    if (random() % 10 == 0) p.x = p.nx = std::nanf("");
  }
  return points;
}

std::string pcd_header(std::size_t n, const std::string& data) {
  return fmt::format(
      "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z rgb _ normal_x normal_y normal_z ring "
      "hist time stamp\n"
      "SIZE 4 4 4 4 1 4 4 4 2 4 8 8\nTYPE F F F F U F F F I F F U\nCOUNT 1 1 1 1 3 1 1 1 1 2 1 1\nWIDTH {}\nHEIGHT 1\n"
      "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {}\nDATA {}\n",
      n, n, data);
}

std::vector<std::string> columns_of(const Point& p) {
  return {raw(p.x),  raw(p.y),  raw(p.z),    raw(p.rgb),           std::string(3, '?'), raw(p.nx),
          raw(p.ny), raw(p.nz), raw(p.ring), std::string(8, '\7'), raw(p.time),         raw(std::uint64_t{5})};
}

std::string binary(const std::vector<Point>& points) {
  std::string bytes = pcd_header(points.size(), "binary");
  for (const Point& p : points) {
    for (const std::string& column : columns_of(p)) bytes += column;
  }
  return bytes;
}

std::string ascii(const std::vector<Point>& points) {
  std::string text = pcd_header(points.size(), "ascii");
  for (const Point& p : points) {
    text += fmt::format("{} {} {} {} 0 0 0 {} {} {} {} 7 7 {:.17g} 5\n", p.x, p.y, p.z, std::bit_cast<float>(p.rgb),
                        p.nx, p.ny, p.nz, p.ring, p.time);
  }
  return text;
}

/// A packer that looks for the nearest repeat the slow way, with runs and matches of every length.
std::string lzf(const std::string& in) {
  std::string out;
  std::string waiting;
  const auto flush = [&] {
    if (!waiting.empty()) out += static_cast<char>(waiting.size() - 1) + waiting;
    waiting.clear();
  };
  for (std::size_t at = 0; at < in.size();) {
    std::size_t best = 0;
    std::size_t back = 0;
    for (std::size_t b = 1; b <= std::min<std::size_t>(at, 300) && best < 264; ++b) {
      std::size_t length = 0;
      while (length < 264 && at + length < in.size() && in[at + length] == in[at + length - b]) ++length;
      if (length > best) std::tie(best, back) = std::pair(length, b);
    }
    if (best >= 3) {
      flush();
      const std::size_t length = best - 2;
      const std::size_t distance = back - 1;
      out += static_cast<char>((std::min<std::size_t>(length, 7) << 5U) | (distance >> 8U));
      if (length >= 7) out += static_cast<char>(length - 7);
      out += static_cast<char>(distance & 255U);
      at += best;
    } else {
      waiting += in[at++];
      if (waiting.size() == 32) flush();
    }
  }
  flush();
  return out;
}

std::string compressed(const std::vector<Point>& points) {
  std::vector<std::string> columns(12);
  for (const Point& p : points) {
    const std::vector<std::string> values = columns_of(p);
    for (std::size_t c = 0; c < values.size(); ++c) columns[c] += values[c];
  }
  std::string data;
  for (const std::string& column : columns) data += column;
  const std::string packed = lzf(data);
  return pcd_header(points.size(), "binary_compressed") + raw(static_cast<std::uint32_t>(packed.size())) +
         raw(static_cast<std::uint32_t>(data.size())) + packed;
}

bool same(float a, float b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}

class PcdPoints : public ::testing::Test {
 protected:
  std::string file(const std::string& bytes) const { return test::write_file(folder_ / "cloud.pcd", bytes); }
  test::TemporaryFolder folder_;
};

TEST_F(PcdPoints, AllEncodingsGiveTheSameRows) {
  const std::vector<Point> points = random_pcd_points(700, 1);
  for (const std::string& bytes : {ascii(points), binary(points), compressed(points)}) {
    const auto source = open_points(file(bytes));
    const PointSourceInfo& info = source->info();
    EXPECT_EQ(info.count, 700);
    EXPECT_TRUE(info.has_normals && info.random_access);
    EXPECT_THAT(test::attribute_names(info), testing::UnorderedElementsAre("red", "green", "blue", "ring", "time"));
    ASSERT_EQ(info.remarks.size(), 1);
    EXPECT_THAT(info.remarks[0], HasSubstr("fields left out: 'hist', 'stamp'"));
    const auto attribute = [&](const char* name) {
      const auto names = test::attribute_names(info);
      return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
    };
    const SampleBatch rows = all_rows(*source, 97);
    ASSERT_EQ(rows.size(), 700);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Point& p = points[i];
      ASSERT_TRUE(same(static_cast<float>(rows.x[i]), p.x)) << i;
      ASSERT_EQ(static_cast<float>(rows.z[i]), p.z);
      ASSERT_TRUE(same(rows.nx[i], p.nx));
      ASSERT_EQ(rows.nz[i], p.nz);
      ASSERT_EQ(rows.attributes[attribute("red")][i], static_cast<float>(p.rgb >> 16U));
      ASSERT_EQ(rows.attributes[attribute("green")][i], static_cast<float>((p.rgb >> 8U) & 255U));
      ASSERT_EQ(rows.attributes[attribute("blue")][i], static_cast<float>(p.rgb & 255U));
      ASSERT_EQ(rows.attributes[attribute("ring")][i], p.ring);
      ASSERT_EQ(rows.exact[attribute("time")][i], p.time);
    }
  }
  EXPECT_EQ(folder_.entries(), 1);  // unpacked data have no name
}

TEST_F(PcdPoints, ColoursAsIntegersWithAlpha) {
  const std::string head =
      "VERSION .7\nFIELDS x y z rgba\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA ";
  const std::uint32_t colour = 0x80102030;
  for (const std::string& bytes :
       {head + "ascii\n1 2 3 2148540464\n", head + "binary\n" + std::string(12, '\0') + raw(colour)}) {
    const auto source = open_points(file(bytes));
    EXPECT_THAT(test::attribute_names(source->info()), ElementsAre("red", "green", "blue", "alpha"));
    const SampleBatch rows = all_rows(*source);
    EXPECT_THAT(rows.attributes[0], ElementsAre(0x10));
    EXPECT_THAT(rows.attributes[2], ElementsAre(0x30));
    EXPECT_THAT(rows.attributes[3], ElementsAre(0x80));
  }
  // The same bits as a signed integer.
  EXPECT_THAT(
      all_rows(file("FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F I\nWIDTH 1\nHEIGHT 1\nDATA ascii\n1 2 3 -5378645\n"))
          .attributes[0],
      ElementsAre(173));
  // The way old files print a packed float: as the integer it stands for.
  const SampleBatch rows =
      all_rows(file("FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nWIDTH 1\nHEIGHT 1\nDATA ascii\n1 2 3 4.2108e+06\n"));
  EXPECT_THAT(rows.attributes[0], ElementsAre(4210800 >> 16));
}

TEST_F(PcdPoints, UnpacksWhateverAnotherPackerMade) {
  std::mt19937 random(2);
  for (int round = 0; round < 30; ++round) {
    std::string data(random() % 3000, '\0');
    const unsigned letters = 1 + random() % 4;
    for (char& c : data) c = static_cast<char>(random() % 20 == 0 ? random() : random() % letters);
    if (round == 0) data.assign(700'000, 'a');  // beyond the window
    const std::string packed = lzf(data);
    test::write_file(folder_ / "data.lzf", "head" + packed);
    const InputFile input = open_input(folder_ / "data.lzf", folder_.path());
    Spool spool("test", folder_.path());
    unpack_lzf(input, 4, packed.size(), data.size(), spool);
    const InputFile out = spool.finish();
    std::string back(data.size() + 1, '\0');
    ASSERT_EQ(out.read(0, back.data(), back.size()), data.size());
    back.pop_back();
    ASSERT_TRUE(back == data) << round;
  }
}

TEST_F(PcdPoints, HeadersThatLieAndDataThatAreCut) {
  const std::vector<Point> points = random_pcd_points(20, 3);
  const auto with = [&](std::string bytes, const std::string& from, const std::string& to) {
    for (std::size_t at = bytes.find(from); at != bytes.npos; at = bytes.find(from, at + to.size()))
      bytes.replace(at, from.size(), to);
    return test::refusal(file(bytes));
  };
  for (const std::string& bytes : {ascii(points), binary(points), compressed(points)}) {
    EXPECT_THAT(with(bytes, "WIDTH 20\n", "WIDTH 30\n"), HasSubstr("POINTS is 20, but WIDTH times HEIGHT 30"));
    std::string more = bytes;
    more.replace(more.find("WIDTH 20"), 8, "WIDTH 4000000000");
    more.replace(more.find("POINTS 20"), 9, "POINTS 4000000000");
    EXPECT_THAT(test::refusal(file(more)), HasSubstr("promise"));
    for (std::size_t size = 0; size < bytes.size(); size += 7) {
      const bool inside_last_line = bytes.find("DATA ascii") != bytes.npos && size + 80 > bytes.size();
      if (!inside_last_line) {
        EXPECT_NE(test::refusal(file(bytes.substr(0, size))), "") << size;
      }
    }
  }
  EXPECT_THAT(with(ascii(points), "WIDTH 20\n", "FIELDS more\nWIDTH 20\n"),
              HasSubstr("line 7: a second list of fields"));
  EXPECT_THAT(with(ascii(points), "SIZE 4 4", "SIZE 3 4"), HasSubstr("field 'x' has TYPE 'F' and SIZE '3'"));
  EXPECT_THAT(with(binary(points), "FIELDS x ", "FIELDS q "), HasSubstr("no field 'x'"));
  EXPECT_THAT(with(binary(points), "DATA binary\n", "DATA base64\n"), HasSubstr("data 'base64' are not known"));
  EXPECT_THAT(test::refusal(file(binary(points) + std::string(5000, 'x'))), HasSubstr("follow the last point"));
}

}  // namespace
}  // namespace lamina

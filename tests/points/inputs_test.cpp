// Several inputs as one stream: names to files, poses, scan lists, gzip, attributes that differ.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <filesystem>
#include <numbers>
#include <random>

#include "base/temporary_folder.h"
#include "points/point_rows.h"

namespace lamina {
namespace {

using test::all_rows;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class Inputs : public ::testing::Test {
 protected:
  std::string write(const std::string& name, const std::string& text) const {
    return test::write_file(folder_ / name, text);
  }
  std::vector<std::string> paths(const std::vector<std::string>& names) const {
    std::vector<std::string> found;
    for (const PointInput& input : expand_inputs(names))
      found.push_back(std::filesystem::path(input.path).filename().string());
    return found;
  }
  static std::string refusal(const std::vector<std::string>& names) {
    try {
      open_points(names, PointSettings{});
    } catch (const Error& e) {
      return e.what();
    }
    return "";
  }
  test::TemporaryFolder folder_;
};

TEST_F(Inputs, FoldersPatternsAndNamesInOrder) {
  for (const char* name : {"b.xyz", "a.xyz", "c.LAS", "notes.md", "picture.png", "[x].xyz"}) write(name, "1 2 3\n");
  std::filesystem::create_directory(folder_ / "sub.ply");
  EXPECT_THAT(paths({folder_.path()}), ElementsAre("[x].xyz", "a.xyz", "b.xyz", "c.LAS"));
  EXPECT_THAT(paths({folder_ / "?.xyz", folder_ / "notes.md"}), ElementsAre("a.xyz", "b.xyz", "notes.md"));
  EXPECT_THAT(paths({folder_ / "[x].xyz"}), ElementsAre("[x].xyz"));  // the name of a file, not a pattern
  EXPECT_THAT(paths({"-"}), ElementsAre("-"));
  EXPECT_THAT(refusal({folder_ / "*.abc"}), HasSubstr("*.abc: no file matches"));
  EXPECT_THAT(refusal({folder_ / "sub.ply"}), HasSubstr("no point files are in this folder"));
  EXPECT_THAT(refusal({folder_ / "none.xyz"}), HasSubstr("none.xyz: cannot be opened"));
  EXPECT_THAT(refusal({}), HasSubstr("no point files were named"));
}

TEST_F(Inputs, PosesMovePointsNormalsAndRadii) {
  const std::string cloud = write("a.csv", "x,y,z,nx,ny,nz,radius\n1,2,3,0,0,1,0.5\n4,5,6,1,0,0,0.5\n");
  // A turn about x (y to z) and twice the size.
  const std::string pose = write("pose.txt", "# rows\n2 0 0 10\n0 0 -2 20\n0 2 0 30\n0 0 0 1\n");
  const auto source = open_points(std::vector{cloud + "@" + pose}, PointSettings{});
  const SampleBatch rows = all_rows(*source);
  EXPECT_THAT(rows.x, ElementsAre(12, 18));
  EXPECT_THAT(rows.y, ElementsAre(14, 8));
  EXPECT_THAT(rows.z, ElementsAre(34, 40));
  EXPECT_THAT(rows.ny, ElementsAre(-1, 0));
  EXPECT_THAT(rows.nx, ElementsAre(0, 1));
  EXPECT_THAT(rows.radius, ElementsAre(1, 1));
  ASSERT_EQ(source->info().scans.size(), 1);
  EXPECT_EQ(source->info().scans[0].scanner, ScanPart::Scanner::pose_origin);
  EXPECT_THAT(source->info().scans[0].at, ElementsAre(10, 20, 30));
  EXPECT_THAT(refusal({cloud + "@" + write("p", "1 2 3\n")}), HasSubstr("3 numbers; a pose is 16"));
  EXPECT_THAT(refusal({cloud + "@" + write("p", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 one\n")}),
              HasSubstr("line 1: a pose is 16 numbers"));
  EXPECT_THAT(refusal({cloud + "@" + write("p", "1 0 0 0 0 1 0 0 0 0 0 0 0 0 0 1\n")}), HasSubstr("singular"));
  EXPECT_THAT(refusal({cloud + "@" + write("p", "1 0 0 0 0 1 0 0 0 0 1 0 1 0 0 1\n")}), HasSubstr("last row"));
  EXPECT_THAT(refusal({cloud + "@" + folder_.path() + "/none"}), HasSubstr("none: cannot be opened"));
}

TEST_F(Inputs, AScanListGivesItsScansTheirPoses) {
  write("one.xyz", "0 0 1\n");
  write("two.xyz", "0 0 1\n");
  const std::string list =
      write("scans.conf",
            "camera 0 0 0 0 0 0 1\nbmesh one.xyz 0 0 0 0 0 0 1\n"
            "bmesh two.xyz -0.0520211 -0.000383981 -0.0109223 0.00548449 -0.294635 -0.0038555 0.955586\n");
  const auto source = open_points(std::vector{list}, PointSettings{});
  const SampleBatch rows = all_rows(*source);
  EXPECT_EQ(rows.z[0], 1);
  // The Stanford bunny's second scan: the scanner's axis turns towards +x, where that scan's normals point on average
  // (0.47 0.19 0.86 in the registered cloud).
  EXPECT_NEAR(rows.x[1], 0.563 - 0.052, 1e-3);
  EXPECT_NEAR(rows.y[1], 0.013, 1e-3);
  EXPECT_NEAR(rows.z[1], 0.826 - 0.011, 1e-3);
  // Its scanner lies in that direction, far away.
  ASSERT_EQ(source->info().scans.size(), 2);
  const ScanPart& scan = source->info().scans[1];
  EXPECT_EQ(scan.first, 1);
  EXPECT_EQ(scan.scanner, ScanPart::Scanner::direction);
  EXPECT_NEAR(scan.at[0], 0.563, 1e-3);
  EXPECT_NEAR(scan.at[2], 0.826, 1e-3);
  EXPECT_THAT(refusal({write("bad.conf", "bmesh a.xyz 0 0 0 0 0 0 0\n")}), HasSubstr("line 1: the quaternion"));
  EXPECT_THAT(refusal({write("bad.conf", "camera 0 0 0 0 0 0 1\nbmesh a.xyz 0 0 0 0 0 0 1 5\n")}),
              HasSubstr("line 2: bmesh FILE"));
  // A pose of the whole list comes after those of the scans.
  const std::string pose = write("up.txt", "1 0 0 0  0 1 0 0  0 0 1 5  0 0 0 1");
  EXPECT_EQ(all_rows(*open_points(std::vector{list + "@" + pose}, PointSettings{})).z[0], 6);
}

TEST_F(Inputs, PublishedPosesOfTheBunny) {
  // The list as Stanford publishes it. The object stands upright, the scanner's axis (its z) points back to it: scans
  // of the sides turn about the vertical by what their names say, "top" ones look from above, the chin's from below.
  // The camera is a viewer's, no scan's.
  const std::string list =
      write("bun.conf",
            "camera -0.0172 -0.0936 -0.734  -0.0461723 0.970603 -0.235889 0.0124573\r\n"
            "bmesh bun000.ply 0 0 0 0 0 0 1\r\n"
            "bmesh bun045.ply -0.0520211 -0.000383981 -0.0109223 0.00548449 -0.294635 -0.0038555 0.955586\r\n"
            "bmesh bun090.ply 2.20761e-05 -3.34606e-05 -7.20881e-05 0.000335889 -0.708202 0.000602459 0.706009\r\n"
            "bmesh bun180.ply 0.000116991 2.47732e-05 -4.6283e-05 -0.00215148 0.999996 -0.0015001 0.000892527\r\n"
            "bmesh bun270.ply 0.000130273 1.58623e-05 0.000406764 0.000462632 0.707006 -0.00333301 0.7072\r\n"
            "bmesh top2.ply -0.0530127 0.138516 0.0990356 0.908911 -0.0569874 0.154429 0.383126\r\n"
            "bmesh bun315.ply -0.00646017 -1.36122e-05 -0.0129064 0.00449209 0.38422 -0.00976512 0.923179\r\n"
            "bmesh chin.ply 0.00435102 0.0882863 -0.108853 -0.441019 0.213083 0.00705734 0.871807\r\n");
  const std::vector<PointInput> scans = expand_inputs({list});
  ASSERT_EQ(scans.size(), 8U);
  const auto axis = [&](const std::string& name) {
    for (const PointInput& scan : scans) {
      const Pose& p = scan.pose;
      if (std::filesystem::path(scan.path).stem() == name) return std::array{p[0][2], p[1][2], p[2][2]};
    }
    return std::array{0.0, 0.0, 0.0};
  };
  const auto sideways = [&](const std::string& name, double degrees, double tolerance) {
    const std::array<double, 3> a = axis(name);
    EXPECT_NEAR(a[1], 0, 0.02) << name;
    EXPECT_NEAR(std::remainder(std::atan2(a[0], a[2]) * 180 / std::numbers::pi - degrees, 360), 0, tolerance) << name;
  };
  sideways("bun000", 0, 0);
  sideways("bun090", 90, 0.5);
  sideways("bun180", 180, 0.5);
  sideways("bun270", 270, 0.5);
  sideways("bun045", 45, 12);  // turned by hand
  sideways("bun315", 315, 2);
  EXPECT_GT(axis("top2")[1], 0.5);
  EXPECT_LT(axis("chin")[1], -0.5);
  EXPECT_EQ(scans[1].pose[0][3], -0.0520211);
  EXPECT_EQ(scans[1].pose[2][3], -0.0109223);
}

TEST_F(Inputs, RangeGridsAreTheirVertices) {
  std::string grid =
      "ply\nformat binary_big_endian 1.0\nobj_info num_cols 2\nobj_info num_rows 2\nelement vertex 2\nproperty float "
      "x\n"
      "property float y\nproperty float z\nelement range_grid 4\nproperty list uchar int vertex_indices\nend_header\n";
  grid += std::string("\x3f\x80\0\0\x40\0\0\0\x40\x40\0\0", 12);    // 1 2 3
  grid += std::string("\x40\x80\0\0\x40\xa0\0\0\x40\xc0\0\0", 12);  // 4 5 6
  grid += std::string(
      "\1\0\0\0\0"
      "\0"
      "\0"
      "\1\0\0\0\1",
      12);
  write("scan.ply", grid);
  const auto source =
      open_points(std::vector{write("scan.conf", "bmesh scan.ply 10 20 30 0 0 0 1\n")}, PointSettings{});
  const SampleBatch rows = all_rows(*source);
  EXPECT_THAT(rows.x, ElementsAre(11, 14));
  EXPECT_THAT(rows.z, ElementsAre(33, 36));
  // A range image is seen along its own z axis.
  const auto alone = open_points(folder_ / "scan.ply");
  ASSERT_EQ(alone->info().scans.size(), 1);
  EXPECT_EQ(alone->info().scans[0].scanner, ScanPart::Scanner::direction);
  EXPECT_THAT(alone->info().scans[0].at, ElementsAre(0, 0, 1));
  EXPECT_EQ(source->info().scans[0].scanner, ScanPart::Scanner::direction);
}

TEST_F(Inputs, JoinedSourcesAreRowsBehindEachOther) {
  std::mt19937 random(3);
  std::vector<std::string> names;
  std::vector<double> expected;
  for (int f = 0; f < 5; ++f) {
    std::string text = "ply\nformat ascii 1.0\nelement vertex ";
    const std::size_t rows = f == 2 ? 0 : random() % 500;
    text += fmt::format("{}\nproperty float x\nproperty float y\nproperty float z\nend_header\n", rows);
    for (std::size_t i = 0; i < rows; ++i) {
      expected.push_back(static_cast<double>(random() % 1000));
      text += fmt::format("{} 0 0\n", expected.back());
    }
    names.push_back(write(fmt::format("{}.ply", f), text));
  }
  const auto source = open_points(names, PointSettings{});
  EXPECT_FALSE(source->info().random_access);
  EXPECT_EQ(source->info().count, expected.size());
  for (const std::size_t piece : {1, 100, 100'000}) EXPECT_TRUE(all_rows(*source, piece).x == expected) << piece;
}

TEST_F(Inputs, AttributesAreTheUnionInTheWidestType) {
  const auto source = open_points(
      std::vector{write("a.csv", "x,y,z,red,green,blue,label\n1,2,3,255,0,51,7\n4,5,6,0,0,0,8\n"),
                  write("b.csv", "x,y,z,quality,red,green,blue\n1,2,3,0.5,65535,0,256\n"), write("c.xyz", "7 8 9\n")},
      PointSettings{});
  const PointSourceInfo& info = source->info();
  EXPECT_EQ(info.count, 4);
  EXPECT_TRUE(info.random_access && info.has_quality);
  EXPECT_EQ(info.quality_name, "quality");
  EXPECT_EQ(info.attributes[0], (AttributeSpec{"red", ScalarType::uint16}));
  EXPECT_THAT(test::attribute_names(info), ElementsAre("red", "green", "blue", "label"));
  const SampleBatch rows = all_rows(*source, 3);
  EXPECT_THAT(rows.attributes[0], ElementsAre(65535, 0, 65535, 0));
  EXPECT_THAT(rows.attributes[2], ElementsAre(51 * 257, 0, 256, 0));
  EXPECT_THAT(rows.attributes[3], ElementsAre(7, 8, 0, 0));
  EXPECT_THAT(rows.quality, ElementsAre(1, 1, 0.5F, 1));
}

TEST_F(Inputs, NormalsMustBeEverybodys) {
  const std::string with = write("a.csv", "x,y,z,nx,ny,nz\n1,2,3,0,0,1\n");
  const auto source = open_points(std::vector{with, write("b.xyz", "1 2 3\n")}, PointSettings{});
  EXPECT_FALSE(source->info().has_normals);
  EXPECT_THAT(source->info().remarks, ElementsAre(HasSubstr("b.xyz has no normals")));
  const auto both = open_points(std::vector{with, with}, PointSettings{});
  EXPECT_TRUE(both->info().has_normals);
  EXPECT_THAT(both->info().remarks, IsEmpty());
  EXPECT_THAT(all_rows(*both).nz, ElementsAre(1, 1));
}

std::string gzip(const std::string& text) {
  std::string packed(compressBound(text.size()) + 64, '\0');
  z_stream stream{};
  deflateInit2(&stream, 6, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  deflate(&stream, Z_FINISH);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

TEST_F(Inputs, GzipIsUnpackedWithoutATrace) {
  std::string text;
  for (int i = 0; i < 40'000; ++i) text += fmt::format("{} 2 3\n", i);
  const std::string packed = gzip(text);
  const std::string path = write("a.xyz.gz", packed);
  EXPECT_EQ(all_rows(path, {folder_.path(), {}}).x[39'999], 39'999);
  EXPECT_EQ(folder_.entries(), 1);
  EXPECT_EQ(all_rows(write("two.gz", packed + gzip("9 9 9\n") + std::string(100, '\0'))).size(), 40'001);
  EXPECT_THAT(test::refusal(write("cut.gz", packed.substr(0, packed.size() / 2))), HasSubstr("cut short at byte"));
  std::string bad = packed;
  bad[bad.size() / 2] = static_cast<char>(bad[bad.size() / 2] ^ 0x55);
  EXPECT_THAT(test::refusal(write("bad.gz", bad)), HasSubstr("the gzip data are damaged at byte"));
  EXPECT_THAT(test::refusal(write("prose.gz", gzip("no points\n"))), HasSubstr("is no point file"));
  EXPECT_THAT(test::refusal(write("tail.gz", packed + "tail")), HasSubstr("damaged"));
}

}  // namespace
}  // namespace lamina

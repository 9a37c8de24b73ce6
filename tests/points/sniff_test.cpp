#include "points/formats.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lamina/error.h"

namespace lamina {
namespace {

using testing::HasSubstr;
using testing::StartsWith;
using namespace std::string_view_literals;

std::string refused_format(std::string_view start, const std::string& name = "cloud.bin") {
  try {
    detect_format(start, name);
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ExitCode::unreadable);
    EXPECT_THAT(e.what(), StartsWith(name));
    return e.what();
  }
  return "";
}

TEST(Sniff, KnowsPlyByItsFirstLine) {
  for (const auto start : {"ply\nformat"sv, "ply\r\nformat"sv, "ply\rformat"sv, "ply \n"sv, "ply"sv}) {
    EXPECT_EQ(detect_format(start, "a"), PointFormat::ply);
  }
}

TEST(Sniff, KnowsFormatsByTheirContentWhateverTheEnding) {
  const std::string las = "LASF" + std::string(200, '\0');
  EXPECT_EQ(detect_format(las, "a.xyz"), PointFormat::las);
  EXPECT_EQ(detect_format("\x20\x42\x44\x56\0\0\0\0"sv, "a.ply"), PointFormat::vdb);
  EXPECT_EQ(detect_format("# .PCD v0.7 - Point Cloud\n\0\0"sv, "a.ply"), PointFormat::pcd);
  EXPECT_EQ(detect_format("VERSION 0.7\nFIELDS x y z\n", "a"), PointFormat::pcd);
  EXPECT_EQ(detect_format("# Blender\n\nmtllib a.mtl\n", "a"), PointFormat::obj);
  EXPECT_EQ(detect_format("v 1 2 3\r\n", "a"), PointFormat::obj);
  for (const auto text : {"0.1 -2e3 4\n1 2 3\n"sv, "# by hand\n1,2,3,4\n"sv, "2\n1 2 3\n4 5 6\n"sv, "1;2;3"sv,
                          "//X Y Z R G B\n1 2 3 4 5 6\n"sv, "\"X\",\"Y\",\"Z\"\n"sv, "0\n"sv, "  1\t2 nan\r"sv,
                          "\xEF\xBB\xBF"
                          "1 2 3\n"sv,
                          "\"1\",\"2\",\"3\"\n"sv}) {
    EXPECT_EQ(detect_format(text, "a.las"), PointFormat::text) << text;
  }
  const std::string ptx =
      "2\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n1 2 3 0.5\n4 5 6 0.5\n";
  EXPECT_EQ(detect_format(ptx, "a.pts"), PointFormat::ptx);
}

TEST(Sniff, TheEndingDecidesWhereTheContentDoesNot) {
  const std::string comment = "# " + std::string(70'000, '-');
  EXPECT_EQ(detect_format(comment, "a.OBJ"), PointFormat::obj);
  EXPECT_EQ(detect_format(comment, "a.xyz.gz"), PointFormat::text);
  EXPECT_NE(refused_format(comment, "a"), "");
  EXPECT_EQ(detect_format("Station1 1 2 3\n", "a.csv"), PointFormat::text);
  std::string laz = "LASF" + std::string(200, '\0');
  laz[104] = '\x83';
  EXPECT_EQ(detect_format(laz, "a"), PointFormat::las);
}

TEST(Sniff, NamesWhatItLooksLikeAndTheRemedy) {
  EXPECT_THAT(refused_format("version https://git-lfs.github.com/spec/v1"), HasSubstr("git lfs pull"));
  EXPECT_THAT(refused_format("\xFF\xFE"
                             "1\0 \0"sv),
              HasSubstr("iconv -f UTF-16"));
  EXPECT_THAT(refused_format("\xEF\xBB\xBFply\n"), HasSubstr("byte order mark"));
  EXPECT_THAT(refused_format("# vtk DataFile Version 3.0\n"), HasSubstr("ParaView"));
  EXPECT_THAT(refused_format("CCB2\3"), HasSubstr("-C_EXPORT_FMT PLY"));
  EXPECT_THAT(refused_format("OFF\n3 1 0\n"), HasSubstr("lamina convert FILE --vertices"));
  EXPECT_THAT(refused_format("camera 0 0 0 0 0 0 1\nbmesh a.ply 0 0 0 0 0 0 1\n"), HasSubstr("list of scans"));
}

TEST(Sniff, OtherwiseSaysItIsNoPointFile) {
  EXPECT_THAT(refused_format("plyx\n"), HasSubstr("is no point file known here"));
  EXPECT_THAT(refused_format("\0\0\0\0\0"sv), HasSubstr("is no point file known here"));
  EXPECT_THAT(refused_format("1 2\n3 4\n"), HasSubstr("is no point file known here"));
  EXPECT_THAT(refused_format("1 2 3\n\0"sv), HasSubstr("is no point file known here"));
  EXPECT_THAT(refused_format("#"), HasSubstr("is no point file known here"));
  EXPECT_THAT(refused_format(""), HasSubstr("is empty"));
}

TEST(Sniff, ScanListsAndEndings) {
  EXPECT_TRUE(is_scan_list("# poses\nbmesh a.ply 0 0 0 0 0 0 1\n"));
  EXPECT_FALSE(is_scan_list("mesh a.ply\n"));
  EXPECT_TRUE(has_point_ending("A.LAS") && has_point_ending("b.xyz.gz") && has_point_ending("c.d.pcd"));
  EXPECT_FALSE(has_point_ending("ply") || has_point_ending("a.png") || has_point_ending("b.gz") ||
               has_point_ending(""));
}

}  // namespace
}  // namespace lamina

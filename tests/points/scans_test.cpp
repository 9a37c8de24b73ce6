// What the readers of organised scans know of their grids.
#include "points/scans.h"

#include <gtest/gtest.h>

#include <string>

#include "base/temporary_folder.h"

namespace lamina {
namespace {

class ScanGrids : public ::testing::Test {
 protected:
  std::vector<PlacedGrid> grids(const std::string& name, const std::string& text) {
    test::write_file(folder_ / name, text);
    const auto source = open_points(folder_ / name);
    SampleBatch rows;
    source->read(0, source->info().count, rows);  // those of lines find their ends only now
    return grids_of(*source);
  }
  /// Which of the first grid's places have rows: a string for each line.
  static std::vector<std::string> picture(const std::vector<PlacedGrid>& grids, std::size_t which = 0) {
    std::vector<std::string> lines;
    if (which >= grids.size()) return lines;
    const ScanGrid& grid = *grids[which].grid;
    for (std::uint64_t l = 0; l < grid.lines(); ++l) {
      lines.emplace_back();
      for (std::uint64_t at = 0; at < grid.length(); ++at) lines.back() += grid.has(l, at) ? '#' : '.';
    }
    return lines;
  }
  test::TemporaryFolder folder_;
};

const char* const kPly =
    "ply\nformat ascii 1.0\nobj_info num_cols 3\nobj_info num_rows 2\nelement vertex 4\nproperty float x\n"
    "property float y\nproperty float z\nelement range_grid 6\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n0 1 0\n2 1 0\n";

TEST_F(ScanGrids, OfRangeImages) {
  const std::vector<PlacedGrid> found = grids("a.ply", std::string(kPly) + "1 0\n1 1\n0\n1 2\n0\n1 3\n");
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].first, 0u);
  EXPECT_EQ(found[0].grid->rows(), 4u);
  EXPECT_EQ(picture(found), (std::vector<std::string>{"##.", "#.#"}));
}

TEST_F(ScanGrids, OfBinaryRangeImages) {
  std::string text = kPly;
  text.replace(text.find("ascii"), 5, "binary_big_endian");
  text.resize(text.find("end_header\n") + 11);
  text.append(4 * 12, '\0');
  for (int vertex = 0; const bool filled : {true, true, false, true, false, true}) {
    text += static_cast<char>(filled);
    if (filled) text += std::string("\0\0\0", 3) + static_cast<char>(vertex++);
  }
  EXPECT_EQ(picture(grids("b.ply", text)), (std::vector<std::string>{"##.", "#.#"}));
}

TEST_F(ScanGrids, NoneWhereTheVerticesAreOthers) {
  EXPECT_TRUE(grids("order.ply", std::string(kPly) + "1 1\n1 0\n0\n1 2\n0\n1 3\n").empty());
  EXPECT_TRUE(grids("few.ply", std::string(kPly) + "1 0\n1 1\n0\n1 2\n0\n0\n").empty());
  EXPECT_TRUE(grids("list.ply", std::string(kPly) + "2 0 1\n1 1\n0\n1 2\n0\n1 3\n").empty());
  std::string unknown = std::string(kPly) + "1 0\n1 1\n0\n1 2\n0\n1 3\n";
  unknown.replace(unknown.find("num_cols"), 8, "something");
  EXPECT_TRUE(grids("width.ply", unknown).empty());
}

TEST_F(ScanGrids, OfPtxColumnByColumnAndScanByScan) {
  const std::string header = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
  const std::string text = "2\n3\n" + header + "1 0 0 0.5\n0 0 0 0.5\n1 1 0 0.5\n1 2 0 0.5\n1 3 0 0.5\n0 0 0 0.5\n" +
                           "1\n2\n" + header + "1 0 1 0.5\n1 1 1 0.5\n";
  const std::vector<PlacedGrid> found = grids("a.ptx", text);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(picture(found), (std::vector<std::string>{"#.#", "##."}));
  EXPECT_EQ(found[1].first, 4u);
  EXPECT_EQ(picture(found, 1), (std::vector<std::string>{"##"}));
}

TEST_F(ScanGrids, OfPcdWithPlacesThatAreNotFinite) {
  const std::string begin = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n";
  const std::string rows = "0 0 1\n1 0 1\nnan nan nan\n0 1 1\n";
  const std::string end = "POINTS 4\nDATA ascii\n" + rows;
  EXPECT_EQ(picture(grids("a.pcd", begin + "WIDTH 2\nHEIGHT 2\nVIEWPOINT 0 0 0 1 0 0 0\n" + end)),
            (std::vector<std::string>{"##", "##"}));
  EXPECT_TRUE(grids("b.pcd", begin + "WIDTH 4\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n" + end).empty());
}

// A picture was taken from the origin, also where its VIEWPOINT turns it, as drivers of cameras write.
TEST_F(ScanGrids, OfPcdAreSeenFromTheOrigin) {
  const auto has_scanner = [&](const std::string& size, const std::string& viewpoint) {
    test::write_file(folder_ / "a.pcd", "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n" + size +
                                            "\nVIEWPOINT " + viewpoint +
                                            "\nPOINTS 4\nDATA ascii\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n");
    const auto source = open_points(folder_ / "a.pcd");
    const std::vector<ScanPart>& scans = source->info().scans;
    return !scans.empty() && scans[0].scanner == ScanPart::Scanner::position;
  };
  EXPECT_TRUE(has_scanner("WIDTH 2\nHEIGHT 2", "0 0 0 1 0 0 0"));
  EXPECT_TRUE(has_scanner("WIDTH 2\nHEIGHT 2", "0 0.0 -0 0 1 0 0"));
  EXPECT_FALSE(has_scanner("WIDTH 2\nHEIGHT 2", "0 0 1 1 0 0 0"));
  EXPECT_FALSE(has_scanner("WIDTH 4\nHEIGHT 1", "0 0 0 1 0 0 0"));
}

TEST_F(ScanGrids, GoThroughPosesAndJoins) {
  test::write_file(folder_ / "a.ply", std::string(kPly) + "1 0\n1 1\n0\n1 2\n0\n1 3\n");
  test::write_file(folder_ / "pose.txt", "0 -1 0 0\n1 0 0 0\n0 0 1 5\n0 0 0 1\n");
  test::write_file(folder_ / "b.xyz", "0 0 0\n1 1 1\n");
  const auto source = open_points({folder_ / "b.xyz", folder_ / "a.ply@" + (folder_ / "pose.txt")}, PointSettings{});
  const std::vector<PlacedGrid> found = grids_of(*source);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].first, 2u);
}

}  // namespace
}  // namespace lamina

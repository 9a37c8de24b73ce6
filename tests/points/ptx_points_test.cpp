// PTX: poses, missing returns, several scans.
#include "points/formats.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/temporary_folder.h"
#include "points/point_rows.h"

namespace lamina {
namespace {

using test::all_rows;
using testing::ElementsAre;
using testing::HasSubstr;

/// A scan turned a quarter about z (x to y) and shifted by 100 200 300: the matrix is stored for points as rows.
std::string scan(int across, int down, const std::string& rows) {
  return fmt::format("{}\n{}\n100 200 300\n0 1 0\n-1 0 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n100 200 300 1\n{}", across,
                     down, rows);
}

class PtxPoints : public ::testing::Test {
 protected:
  std::string write(const std::string& text) const { return test::write_file(folder_ / "cloud.ptx", text); }
  test::TemporaryFolder folder_;
};

TEST_F(PtxPoints, AppliesPosesAndLeavesOutMissingReturns) {
  const auto source = open_points(write(scan(2, 2, "1 2 3 0.5\n0 0 0 0.500000\n0.000 -0 +0.0 0.5\n4 5 6 0.25\n") +
                                        scan(1, 1, "0 0 0 0.5\n") + scan(1, 2, "7 8 9 1\n0 0 1 1\n")));
  EXPECT_EQ(source->info().count, 4);
  EXPECT_EQ(source->info().attributes, (AttributeLayout{{"intensity", ScalarType::float32}}));
  for (const std::size_t piece : {1, 3, 10}) {
    const SampleBatch rows = all_rows(*source, piece);
    EXPECT_THAT(rows.x, ElementsAre(98, 95, 92, 100));
    EXPECT_THAT(rows.y, ElementsAre(201, 204, 207, 200));
    EXPECT_THAT(rows.z, ElementsAre(303, 306, 309, 301));
    EXPECT_THAT(rows.attributes[0], ElementsAre(0.5F, 0.25F, 1, 1));
  }
}

TEST_F(PtxPoints, KnowsWhereItsScannersStood) {
  const auto source =
      open_points(write(scan(2, 1, "1 2 3 0.5\n4 5 6 1\n") + scan(1, 1, "0 0 0 0.5\n") + scan(1, 1, "7 8 9 1\n")));
  const std::vector<ScanPart>& scans = source->info().scans;
  ASSERT_EQ(scans.size(), 2);  // the empty one has no rows
  EXPECT_EQ(scans[1].first, 2);
  for (const ScanPart& s : scans) {
    EXPECT_EQ(s.scanner, ScanPart::Scanner::position);
    EXPECT_THAT(s.at, ElementsAre(100, 200, 300));
  }
}

TEST_F(PtxPoints, PublishedExample) {
  // Pose, points and what becomes of them as LAStools' makers publish them ("Matrix transformation in LAStools"), three
  // of six returns; coordinates there are rounded to millimetres.
  const auto source = open_points(
      write("2\n3\n0.000000 0.000000 0.000000\n1.000000 0.000000 0.000000\n0.000000 1.000000 0.000000\n"
            "0.000000 0.000000 1.000000\n-0.955179 0.296021 -0.002106 0.000000\n-0.296023 -0.955180 0.001152 0.000000\n"
            "-0.001670 0.001724 0.999997 0.000000\n3.847211 12.235314 -0.425777 1.000000\n"
            "1.111111 2.111111 3.111 0.111\n1.222222 2.222222 3.222 0.212\n0 0 0 0\n0 0 0 0 \n"
            "1.333333 2.333333 3.333 0.312\n0 0 0 0\n"));
  const SampleBatch rows = all_rows(*source);
  ASSERT_EQ(rows.size(), 3U);
  const double expected[3][3] = {{2.156, 10.553, 2.685}, {2.017, 10.480, 2.796}, {1.877, 10.407, 2.907}};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(rows.x[i], expected[i][0], 5.1e-4);
    EXPECT_NEAR(rows.y[i], expected[i][1], 5.1e-4);
    EXPECT_NEAR(rows.z[i], expected[i][2], 5.1e-4);
  }
}

TEST_F(PtxPoints, LineEndsOfOtherSystems) {
  std::string text = scan(2, 2, "1 2 3 0.5 10 20 30\n0 0 0 0.5 0 0 0\n4 5 6 0.25 40 50 60\n0 0 0 0 0 0 0\n") +
                     scan(1, 1, "7 8 9 1 70 80 90\n");
  const SampleBatch expected = all_rows(write(text));
  ASSERT_EQ(expected.size(), 3U);
  for (const std::string end : {"\r\n", "\r"}) {
    std::string other;
    for (const char c : text) other += c == '\n' ? end : std::string(1, c);
    for (const std::string& whole : {other, other.substr(0, other.size() - end.size())}) {  // also without the last one
      const SampleBatch rows = all_rows(write(whole));
      EXPECT_EQ(rows.x, expected.x);
      EXPECT_EQ(rows.z, expected.z);
      EXPECT_EQ(rows.attributes, expected.attributes);
    }
  }
}

TEST_F(PtxPoints, PosesThatScaleAndMirror) {
  // Millimetres to metres, and x mirrored: as the matrix says, whatever the lines above it say.
  const std::string header = "1\n2\n9 9 9\n1 0 0\n0 1 0\n0 0 1\n-0.001 0 0 0\n0 0.001 0 0\n0 0 0.001 0\n1 2 3 1\n";
  const auto source = open_points(write(header + "1000 2000 3000 0.5\n-500 0 0 0.5\n"));
  const SampleBatch rows = all_rows(*source);
  EXPECT_THAT(rows.x, ElementsAre(0, 1.5));
  EXPECT_THAT(rows.y, ElementsAre(4, 2));
  EXPECT_THAT(rows.z, ElementsAre(6, 3));
  ASSERT_EQ(source->info().scans.size(), 1U);
  EXPECT_THAT(source->info().scans[0].at, ElementsAre(1, 2, 3));
  for (const auto& [good, bad] : {std::pair{"1 2 3 1", "1 2 3 0"}, std::pair{"1 2 3 1", "nan 2 3 1"},
                                  std::pair{"0 0.001 0 0", "0 0.001 0 1"}, std::pair{"0 0.001 0 0", "0.001 0 0 0"}}) {
    std::string text = header;
    text.replace(text.find(good), std::string(good).size(), bad);
    EXPECT_THAT(test::refusal(write(text + "1 2 3 0.5\n1 2 3 0.5\n")), HasSubstr("line 7")) << bad;
  }
}

TEST_F(PtxPoints, ScansMustAgreeAboutTheirValues) {
  EXPECT_THAT(test::refusal(write(scan(1, 1, "1 2 3 0.5\n") + scan(1, 1, "1 2 3 0.5 10 20 30\n"))),
              HasSubstr("line 22: 4 values expected, more stand there"));
}

TEST_F(PtxPoints, Colours) {
  const auto source = open_points(write(scan(1, 1, "1 2 3 0.5 10 20 30\n")));
  EXPECT_EQ(source->info().attributes[3], (AttributeSpec{"blue", ScalarType::uint8}));
  EXPECT_THAT(all_rows(*source).attributes[3], ElementsAre(30));
}

TEST_F(PtxPoints, RefusalsNameTheLine) {
  EXPECT_THAT(test::refusal(write(scan(2, 2, "1 2 3 0.5\n"))),
              HasSubstr("2 by 2 points lacks 3 of them when the file ends at line 11"));
  EXPECT_THAT(test::refusal(write(scan(1, 1, "1 2 3 1\n4 5 6 1\n"))),
              HasSubstr("line 12: a scan's header should have 1 numbers"));
  EXPECT_THAT(test::refusal(write(scan(1, 1, "1 2 3 1\n") + "2\n2\n")), HasSubstr("in the header of a scan"));
  EXPECT_THAT(test::refusal(write(scan(1, 1, "1 2 3 1 5\n"))), HasSubstr("line 11: 5 values"));
  EXPECT_THAT(test::refusal(write(scan(1, 1, "1 b 3 1\n"))), HasSubstr("line 11: 'b' is no number"));
  std::string flat = scan(1, 1, "1 2 3 1\n");
  flat.replace(flat.find("0 0 1 0"), 7, "0 0 0 0");
  EXPECT_THAT(test::refusal(write(flat)), HasSubstr("line 7: the pose is singular"));
  EXPECT_THAT(test::refusal(write(scan(2'000'000'000, 2'000'000'000, "1 2 3 1\n"))), HasSubstr("cut short"));
}

}  // namespace
}  // namespace lamina

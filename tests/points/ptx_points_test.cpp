// PTX: poses, missing returns, several scans.
#include "points/ptx_points.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/temporary_folder.h"
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

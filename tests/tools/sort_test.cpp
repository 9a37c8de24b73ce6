#include "lamina/edit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <numeric>

#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina::tools {
namespace {

using namespace test;
using ::testing::HasSubstr;

class SortTool : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  SampleBatch rows_ = sphere_rows(3000, 5);
  std::string cloud_ = write_points(folder_ / "cloud.ply", rows_, sphere_columns());
  std::string out_ = folder_ / "out.ply";

  std::vector<std::string> sorted(const std::vector<double>& keys) const {
    std::vector<std::size_t> order(keys.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return keys[a] < keys[b]; });
    const auto texts = row_texts(rows_);
    std::vector<std::string> out;
    for (const auto i : order) out.push_back(texts[i]);
    return out;
  }
};

TEST_F(SortTool, OrdersByAxesAndAttributesKeepingEqualOnesInOrder) {
  ASSERT_EQ(run_lamina({"sort", cloud_, "--by", "y", "-o", out_}).code, 0);
  EXPECT_EQ(row_texts(read_points(out_)), sorted(rows_.y));
  ASSERT_EQ(run_lamina({"sort", cloud_, "--attribute", "red", "-o", out_}).code, 0);
  EXPECT_EQ(row_texts(read_points(out_)), sorted({rows_.attributes[0].begin(), rows_.attributes[0].end()}));
  ASSERT_EQ(run_lamina({"sort", cloud_, "--attribute", "id", "-o", out_}).code, 0);
  EXPECT_EQ(row_texts(read_points(out_)), sorted(rows_.exact[3])) << "ids that no float tells apart";
  std::vector<double> keys;
  for (const float q : rows_.quality) keys.push_back(-static_cast<double>(q));
  ASSERT_EQ(run_lamina({"sort", cloud_, "--attribute", "confidence", "--reverse", "-o", out_}).code, 0);
  EXPECT_EQ(row_texts(read_points(out_)), sorted(keys));
}

TEST_F(SortTool, EveryOrderIsAPermutation) {
  auto expected = row_texts(rows_);
  std::sort(expected.begin(), expected.end());
  for (const std::string by : {"x", "z", "sweep", "spatial"}) {
    ASSERT_EQ(run_lamina({"sort", cloud_, "--by", by, "-o", out_}).code, 0);
    auto texts = row_texts(read_points(out_));
    std::sort(texts.begin(), texts.end());
    EXPECT_EQ(texts, expected) << by;
  }
}

double steps_length(const SampleBatch& rows) {
  double sum = 0;
  for (std::size_t i = 1; i < rows.size(); ++i)
    sum += std::hypot(rows.x[i] - rows.x[i - 1], rows.y[i] - rows.y[i - 1], rows.z[i] - rows.z[i - 1]);
  return sum;
}

TEST_F(SortTool, SpatialNeighboursAreNeighboursInTheFile) {
  ASSERT_EQ(run_lamina({"sort", cloud_, "-o", out_}).code, 0);
  EXPECT_LT(steps_length(read_points(out_)), 0.1 * steps_length(rows_));
}

TEST_F(SortTool, SweepFollowsTheDominantAxis) {
  SampleBatch rows = rows_;
  for (std::size_t i = 0; i < rows.size(); ++i) {  // stretched along (1, 2, 0)
    const double along = 5 * rows.z[i];
    rows.x[i] += along;
    rows.y[i] += 2 * along;
  }
  write_points(cloud_, rows, sphere_columns());
  ASSERT_EQ(run_lamina({"sort", cloud_, "--by", "sweep", "-o", out_}).code, 0);
  const SampleBatch swept = read_points(out_);
  double worst = 0;
  for (std::size_t i = 1; i < swept.size(); ++i)
    worst = std::max(worst, swept.x[i - 1] + 2 * swept.y[i - 1] - swept.x[i] - 2 * swept.y[i]);
  EXPECT_LT(worst, 0.5) << "but for the sphere's own asymmetry the axis is (1, 2, 0)";
}

TEST_F(SortTool, RefusesWhatNeedsMoreMemory) {
  const auto outcome = run_lamina({"sort", cloud_, "-o", out_, "--max-memory", "20M"});
  EXPECT_EQ(outcome.code, 4);
  EXPECT_THAT(outcome.err, ::testing::AllOf(::testing::HasSubstr(cloud_), ::testing::HasSubstr("--max-memory")));
  EXPECT_FALSE(std::filesystem::exists(out_));
}

/// Rows with an infinite coordinate never leave; the sorter's runs are a few rows long.
TEST_F(SortTool, SortsInRunsWithLittleMemoryTheSameBytes) {
  ASSERT_EQ(run_lamina({"sort", cloud_, "-o", out_}).code, 0);
  const std::string few = folder_ / "few.ply";
  SortSettings settings;
  settings.memory = 5000;
  const auto source = open_points(cloud_);
  const auto writer = open_points_writer(few, columns_of(source->info()));
  sort_points(*source, *writer, settings, {});
  writer->commit();
  EXPECT_TRUE(read_text(out_) == read_text(few));
  EXPECT_EQ(folder_.entries(), 3) << "temporary files have no names";
}

TEST_F(SortTool, BadRowsAreLeftOutOrRefused) {
  rows_.z[17] = std::numeric_limits<double>::quiet_NaN();
  rows_.nx[40] = std::numeric_limits<float>::infinity();
  // The writer itself refuses such rows, so the file is made by hand: 8 bytes a coordinate behind the header.
  const std::string good = read_text(cloud_);
  const std::size_t header = good.find("end_header\n") + 11, row = (good.size() - header) / rows_.size();
  std::string bad = good;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const float infinite = std::numeric_limits<float>::infinity();
  bad.replace(header + 17 * row + 16, 8, std::string(reinterpret_cast<const char*>(&nan), 8));
  bad.replace(header + 40 * row + 24, 4, std::string(reinterpret_cast<const char*>(&infinite), 4));
  write_file(cloud_, bad);
  const auto dropped = run_lamina({"sort", cloud_, "-o", out_});
  EXPECT_EQ(dropped.code, 0);
  EXPECT_THAT(dropped.err, HasSubstr("1 of 3000 rows are not finite, the first is row 17"));
  EXPECT_THAT(dropped.err, HasSubstr("1 of 3000 normals are not finite; they become 0 0 0"));
  EXPECT_EQ(read_points(out_).size(), 2999U);
  EXPECT_EQ(run_lamina({"sort", cloud_, "--bad-samples", "refuse", "-o", out_}).code, 3);
}

TEST_F(SortTool, AnswersMistakesWithTheirCodes) {
  const auto unknown = run_lamina({"sort", cloud_, "--attribute", "rde", "-o", out_});
  EXPECT_EQ(unknown.code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("confidence, red, green, blue, id"));
  EXPECT_EQ(run_lamina({"sort", cloud_, "--by", "w", "-o", out_}).code, 2);
  EXPECT_EQ(run_lamina({"sort", cloud_, "--by", "x", "--attribute", "red", "-o", out_}).code, 2);
  EXPECT_EQ(run_lamina({"sort", folder_ / "none.ply", "-o", out_}).code, 3);
}

}  // namespace
}  // namespace lamina::tools

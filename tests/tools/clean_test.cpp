#include "lamina/clean.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>

#include "lamina/mesh.h"
#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina::tools {
namespace {

using namespace test;
using ::testing::AllOf;
using ::testing::HasSubstr;

void append_row(SampleBatch& to, const SampleBatch& from, std::size_t i) {
  for (auto column : {&SampleBatch::x, &SampleBatch::y, &SampleBatch::z}) (to.*column).push_back((from.*column)[i]);
  for (auto column : {&SampleBatch::nx, &SampleBatch::ny, &SampleBatch::nz, &SampleBatch::quality})
    (to.*column).push_back((from.*column)[i]);
  for (std::size_t a = 0; a < to.attributes.size(); ++a) {
    to.attributes[a].push_back(from.attributes[a][i]);
    if (!from.exact[a].empty()) to.exact[a].push_back(from.exact[a][i]);
  }
}

class CleanTool : public ::testing::Test {
 protected:
  Outcome clean(const SampleBatch& rows, std::vector<std::string> options) {
    write_points(cloud_, rows, sphere_columns());
    options.insert(options.begin(), {"clean", cloud_, "-o", out_});
    return run_lamina(options);
  }
  TemporaryFolder folder_;
  SampleBatch rows_ = sphere_rows(8000, 3);
  const std::string cloud_ = folder_ / "cloud.ply", out_ = folder_ / "out.ply";
};

TEST_F(CleanTool, MergesEqualPositionsAndKeepsEverythingElseToTheBit) {
  SampleBatch rows = rows_;
  for (std::size_t i = 0; i < 500; ++i) append_row(rows, rows_, 3 * i);
  const auto outcome = clean(rows, {"--merge", "0"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("500 duplicates merged"));
  EXPECT_EQ(row_texts(read_points(out_)), row_texts(rows_)) << "the first of each stays, rows in order";
}

TEST_F(CleanTool, RefusesWhatNeedsMoreMemory) {
  const auto outcome = clean(rows_, {"--outliers", "3", "--max-memory", "50M"});
  EXPECT_EQ(outcome.code, 4);
  EXPECT_THAT(outcome.err, HasSubstr("--max-memory"));
}

TEST_F(CleanTool, NearDuplicatesAreThoseThatFaceTheSameWay) {
  // Both sides of a sheet thinner than the tolerance.
  SampleBatch rows = rows_;
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    append_row(rows, rows_, i);
    rows.x.back() *= 0.9999, rows.y.back() *= 0.9999, rows.z.back() *= 0.9999;
    rows.nx.back() *= -1, rows.ny.back() *= -1, rows.nz.back() *= -1;
  }
  ASSERT_EQ(clean(rows, {"--merge", "0.0005"}).code, 0);
  const SampleBatch left = read_points(out_);
  const auto outside = std::count_if(left.x.begin(), left.x.end(), [&, i = 0](double) mutable {
    const bool out = left.nx[i] * left.x[i] + left.ny[i] * left.y[i] + left.nz[i] * left.z[i] > 0;
    ++i;
    return out;
  });
  EXPECT_NEAR(static_cast<double>(outside), static_cast<double>(left.size()) / 2, 20);
  EXPECT_GT(left.size(), 2 * rows_.size() - 100);
}

TEST_F(CleanTool, StrayPointsGoAndTheSurfaceStays) {
  SampleBatch rows = rows_;
  std::mt19937 random(5);
  std::uniform_real_distribution<> at(-3, 3);
  std::set<double> strays;
  while (strays.size() < 200) {
    const double x = at(random), y = at(random), z = at(random);
    if (std::abs(std::hypot(x, y, z) - 1) < 0.3) continue;
    append_row(rows, rows_, strays.size());
    rows.x.back() = x, rows.y.back() = y, rows.z.back() = z;
    strays.insert(x);
  }
  ASSERT_EQ(clean(rows, {"--outliers", "3"}).code, 0);
  const SampleBatch left = read_points(out_);
  EXPECT_LE(std::count_if(left.x.begin(), left.x.end(), [&](double x) { return strays.contains(x); }), 6)
      << "two or three lie next to each other";
  EXPECT_GT(left.size(), 0.995 * static_cast<double>(rows_.size()));
}

TEST_F(CleanTool, StraysAreToldWithoutNormals) {
  PointColumns columns = sphere_columns();
  columns.normals = false;
  SampleBatch rows = rows_;
  for (const double far : {1.3, 1.4, 1.5, 1.6}) {
    append_row(rows, rows_, 0);
    rows.x.back() *= far, rows.y.back() *= far, rows.z.back() *= far;
  }
  write_points(cloud_, rows, columns);
  const auto outcome = run_lamina({"clean", cloud_, "-o", out_, "--strays"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const SampleBatch left = read_points(out_);
  EXPECT_GT(left.size(), 0.99 * static_cast<double>(rows_.size())) << "a sphere, seen from all sides";
  for (std::size_t i = 0; i < left.size(); ++i) EXPECT_LT(std::hypot(left.x[i], left.y[i], left.z[i]), 1.01);
}

TEST_F(CleanTool, SpacingLeavesNoPairNearerAndNoGapWider) {
  const double spacing = 0.1;
  ASSERT_EQ(clean(rows_, {"--spacing", "0.1"}).code, 0);
  const SampleBatch left = read_points(out_);
  const auto distance = [](const SampleBatch& a, std::size_t i, const SampleBatch& b, std::size_t j) {
    return std::hypot(a.x[i] - b.x[j], a.y[i] - b.y[j], a.z[i] - b.z[j]);
  };
  for (std::size_t i = 0; i < left.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) ASSERT_GT(distance(left, i, left, j), spacing * (1 - 1e-6));
  }
  for (std::size_t i = 0; i < rows_.size(); i += 7) {
    double nearest = 9;
    for (std::size_t j = 0; j < left.size(); ++j) nearest = std::min(nearest, distance(rows_, i, left, j));
    ASSERT_LE(nearest, spacing * (1 + 1e-6));
  }
}

TEST_F(CleanTool, PicksRowsByPlaceAndNumber) {
  const auto outcome = clean(rows_, {"--clip=-2,-2,0,2,2,2", "--every", "3"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  SampleBatch expected;
  expected.attributes.resize(4), expected.exact.resize(4);
  for (std::size_t i = 0; i < rows_.size(); i += 3) {
    if (rows_.z[i] >= 0) append_row(expected, rows_, i);
  }
  EXPECT_EQ(row_texts(read_points(out_)), row_texts(expected));
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("outside the box"), HasSubstr("5333 skipped")));
}

TEST_F(CleanTool, ThreadsDoNotMatter) {
  const std::vector<std::string> options{"--merge", "0.01", "--outliers", "2", "--spacing", "0.05", "--quiet"};
  std::string bytes;
  for (const char* threads : {"1", "2", "5"}) {
    std::vector<std::string> words = options;
    words.insert(words.end(), {"--threads", threads});
    ASSERT_EQ(clean(rows_, words).code, 0);
    if (bytes.empty()) bytes = read_file(out_);
    EXPECT_TRUE(read_file(out_) == bytes) << threads;
  }
}

TEST_F(CleanTool, AnswersMistakesWithTheirCodes) {
  const std::vector<std::pair<std::vector<std::string>, int>> mistakes{{{}, 2},
                                                                       {{"--every", "0"}, 2},
                                                                       {{"--merge", "-1"}, 2},
                                                                       {{"--outliers", "-1"}, 2},
                                                                       {{"--outliers", "2", "--neighbours", "0"}, 2},
                                                                       {{"--spacing", "nan"}, 2},
                                                                       {{"--clip", "1,1,1,0,0,0"}, 2},
                                                                       {{"--clip", "7,7,7,8,8,8"}, 5},
                                                                       {{"--clip", "7,7,7,8,8,8", "--merge", "0"}, 5}};
  for (auto [options, code] : mistakes) {
    options.push_back("--quiet");
    const auto outcome = clean(rows_, options);
    EXPECT_EQ(outcome.code, code) << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(out_));
  }
}

TEST_F(CleanTool, BadRowsAreNamedByTheirNumberInTheFile) {
  const std::string text = folder_ / "cloud.xyz";
  write_file(text, "0 0 0\n1 0 0\nnan 0 0\n0 0 1\n1 1 1\n0 0 0\n");
  const auto outcome = run_lamina({"clean", text, "--columns", "x,y,z", "--merge", "0", "-o", out_});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("row 2"), HasSubstr("1 duplicates merged")));
  EXPECT_EQ(read_points(out_).x, (std::vector<double>{0, 1, 0, 1}));
}

// The same steps inside a reconstruction.
TEST_F(CleanTool, TheSurfaceOfACloudIsThatOfTheCleanedCloud) {
  SampleBatch rows = rows_;
  for (std::size_t i = 0; i < 500; ++i) append_row(rows, rows_, 3 * i);
  const std::string mesh = folder_ / "mesh.ply", stats = folder_ / "stats.json";
  ASSERT_EQ(clean(rows, {"--merge", "0", "--outliers", "4"}).code, 0);
  ASSERT_EQ(run_lamina({"surface", out_, "-o", mesh, "--raw", "--quiet"}).code, 0);
  const TriangleMesh apart = read_mesh(mesh);
  const auto outcome =
      run_lamina({"surface", cloud_, "-o", mesh, "--merge", "0", "--outliers", "4", "--raw", "--stats", stats});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("500 duplicates merged"));
  const TriangleMesh together = read_mesh(mesh);
  // The frame is chosen before duplicates go: the same surface, in a lattice turned a little.
  EXPECT_NEAR(static_cast<double>(together.triangles.size()), static_cast<double>(apart.triangles.size()),
              0.02 * static_cast<double>(apart.triangles.size()));
  const auto j = nlohmann::json::parse(read_file(stats));
  EXPECT_EQ(j["cleaned"]["merged"], 500);
  EXPECT_EQ(j["samples_used"], read_points(out_).size());
}

TEST_F(CleanTool, ASurfaceIsClippedWhileReading) {
  write_points(cloud_, rows_, sphere_columns());
  const std::string mesh = folder_ / "mesh.ply";
  const auto outcome = run_lamina({"surface", cloud_, "-o", mesh, "--clip=-2,-2,0,2,2,2"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("outside the box"));
  double lowest = 1;
  for (const auto& p : read_mesh(mesh).positions) lowest = std::min(lowest, p[2]);
  EXPECT_NEAR(lowest, 0, 0.15);
  EXPECT_EQ(run_lamina({"surface", cloud_, "-o", mesh, "--clip", "7,7,7,8,8,8"}).code, 5);
}

TEST_F(CleanTool, SmallPartsOfAMeshArePruned) {
  SampleBatch rows = rows_;
  const SampleBatch crumbs = sphere_rows(300, 8);
  for (std::size_t i = 0; i < crumbs.size(); ++i) {
    append_row(rows, crumbs, i);
    rows.x.back() = 3 + 0.2 * crumbs.x[i], rows.y.back() = 0.2 * crumbs.y[i], rows.z.back() = 0.2 * crumbs.z[i];
  }
  write_points(cloud_, rows, sphere_columns());
  const std::string mesh = folder_ / "mesh.ply", stats = folder_ / "stats.json";
  ASSERT_EQ(run_lamina({"surface", cloud_, "-o", mesh, "--quiet"}).code, 0);
  const std::size_t all = read_mesh(mesh).triangles.size();
  for (const std::vector<std::string>& options :
       {std::vector<std::string>{"--prune", "1000"}, std::vector<std::string>{"--prune-size", "1"}}) {
    std::vector<std::string> words{"surface", cloud_, "-o", mesh, "--stats", stats};
    words.insert(words.end(), options.begin(), options.end());
    const auto outcome = run_lamina(words);
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("1 connected parts, "));
    const TriangleMesh pruned = read_mesh(mesh);
    for (const auto& p : pruned.positions) ASSERT_LT(p[0], 2);
    const auto j = nlohmann::json::parse(read_file(stats));
    EXPECT_EQ(j["pruned"]["kept_parts"], 1);
    EXPECT_EQ(j["triangles"], pruned.triangles.size());
    EXPECT_EQ(pruned.triangles.size() + j["pruned"]["removed_triangles"].get<std::size_t>(), all);
  }
  EXPECT_EQ(run_lamina({"surface", cloud_, "-o", mesh, "-q", "--prune", "1000000"}).code, 5);
}

}  // namespace
}  // namespace lamina::tools

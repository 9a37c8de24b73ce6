// Large inputs are read once, in a frame chosen by a part of their rows.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "base/temporary_folder.h"
#include "store/ingest.h"

namespace lamina {
namespace {

constexpr std::uint64_t kRows = 600'000;

/// Rows that are computed, not read.
class ComputedRows final : public PointSource {
 public:
  using Row = std::function<std::array<double, 3>(std::uint64_t)>;
  explicit ComputedRows(Row row, bool any_order = true) : row_(std::move(row)) {
    info_.path = "computed";
    info_.count = kRows;
    info_.has_normals = true;
    info_.has_quality = true;
    info_.random_access = any_order;
  }
  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(count, kRows - std::min(first, kRows)));
    out.first = first;
    for (auto* values : {&out.x, &out.y, &out.z}) values->resize(n);
    for (auto* values : {&out.nx, &out.ny, &out.nz}) values->assign(n, 1.0F);
    out.quality.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
      const auto p = row_(first + i);
      out.x[i] = p[0];
      out.y[i] = p[1];
      out.z[i] = p[2];
      out.quality[i] = first + i == best ? 1e30F : others;
    }
  }
  std::uint64_t best = kRows;  ///< row of enormous quality
  float others = 1;            ///< quality of the other rows

 private:
  Row row_;
};

/// A helix around an oblique axis, from one end to the other: every part of the file is another part of the cloud.
std::array<double, 3> helix(std::uint64_t row) {
  const double t = static_cast<double>(row) / static_cast<double>(kRows);
  const double c = std::cos(6000 * t);
  const double s = std::sin(6000 * t);
  return {3 * t + 0.3 * c, 2 * t - 0.3 * c + 0.2 * s, t - 0.3 * c - 0.4 * s};
}

struct Read {
  Survey part;
  Frame frame;
  std::unique_ptr<Ingested> ingested;
};

Read read_by_part(PointSource& source) {
  const test::TemporaryFolder folder;
  const auto part = survey_part(source);
  if (!part) throw std::runtime_error("no survey");
  Read out{*part, choose_frame(*part, FrameMode::pca), nullptr};
  out.ingested = std::make_unique<Ingested>(ingest(source, *part, out.frame, folder.path(), {}));
  return out;
}

Ingested read_twice(PointSource& source) {
  const test::TemporaryFolder folder;
  const Survey survey = survey_input(source, BadSamples::drop, {});
  return ingest(source, survey, choose_frame(survey, FrameMode::pca), folder.path(), {});
}

TEST(ReadOnce, PartOfASortedFileGivesTheFrameOfAll) {
  ComputedRows source(helix);
  const Read r = read_by_part(source);
  const Survey all = survey_input(source, BadSamples::drop, {});
  const Frame frame = choose_frame(all, FrameMode::pca);
  EXPECT_LT((frame.rotation - r.frame.rotation).norm(), 0.02);
  EXPECT_EQ(frame.step, r.frame.step);
  EXPECT_EQ(r.part.usable, kRows);
  ASSERT_TRUE(r.ingested->complete);
  EXPECT_EQ(r.ingested->store.total(), kRows);
  // What the pass over all rows finds out is the same.
  EXPECT_EQ(r.ingested->census.usable, all.usable);
  EXPECT_EQ(r.ingested->census.low, all.low);
  EXPECT_EQ(r.ingested->census.high, all.high);
  EXPECT_EQ(r.ingested->census.max_quality, all.max_quality);
  // No bucket swallows what the others miss.
  std::uint64_t most = 0;
  for (std::size_t b = 0; b < r.ingested->store.buckets(); ++b) most = std::max(most, r.ingested->store.count(b));
  EXPECT_LT(most, 4 * kRows / r.ingested->store.buckets());
}

TEST(ReadOnce, DefectsAreFoundOnTheWay) {
  ComputedRows source([](std::uint64_t row) {
    auto p = helix(row);
    if (row == 1'234 || row == 400'001) p[1] = std::nan("");
    return p;
  });
  const Read r = read_by_part(source);
  ASSERT_TRUE(r.ingested->complete);
  const auto k = static_cast<std::size_t>(Defect::position);
  EXPECT_EQ(r.ingested->census.rejected[k], 2U);
  EXPECT_EQ(r.ingested->census.first_row[k], 1'234U);
  EXPECT_EQ(r.ingested->store.total(), kRows - 2);
  RunContext quiet;
  EXPECT_THROW(judge(r.ingested->census, source.info(), BadSamples::refuse, quiet), std::exception);
}

// A far sample that no part of the file promised: the first pass says so, the second one is right.
TEST(ReadOnce, FarSamplesAreNoticed) {
  double far = 8;
  ComputedRows source([&](std::uint64_t row) {
    auto p = helix(row);
    if (row == 32'000) p[0] = far;  // between the runs looked at
    return p;
  });
  for (; far < 1e31; far *= 1e10) EXPECT_FALSE(read_by_part(source).ingested->complete) << far;
  far = 1e3;
  const Ingested again = read_twice(source);
  EXPECT_TRUE(again.complete);
  EXPECT_EQ(again.store.total(), kRows);
}

TEST(ReadOnce, EnormousQualitiesAreNoticed) {
  ComputedRows source(helix);
  source.best = 32'000;
  EXPECT_FALSE(read_by_part(source).ingested->complete);
  const Ingested again = read_twice(source);
  EXPECT_TRUE(again.complete);
  LocalSamples samples;
  for (std::size_t b = 0; b < again.store.buckets(); ++b) {
    again.store.read(b, samples);
    for (const float q : samples.quality) ASSERT_LE(q, 1.0F);
  }
}

// Zeros alone tell no weights: with one quality above they do.
TEST(ReadOnce, TheOnlyQualityAboveZeroIsNoticed) {
  ComputedRows source(helix);
  source.others = 0;
  EXPECT_TRUE(read_by_part(source).ingested->complete);
  source.best = 32'000;
  EXPECT_FALSE(read_by_part(source).ingested->complete);
}

TEST(ReadOnce, NotWhereRowsComeInOneOrderOrMakeNoFrame) {
  ComputedRows sequential(helix, false);
  EXPECT_FALSE(survey_part(sequential).has_value());
  ComputedRows place([](std::uint64_t) { return std::array<double, 3>{1, 2, 3}; });
  EXPECT_FALSE(survey_part(place).has_value());
  ComputedRows nothing([](std::uint64_t) { return std::array<double, 3>{std::nan(""), 2, 3}; });
  EXPECT_FALSE(survey_part(nothing).has_value());
}

}  // namespace
}  // namespace lamina

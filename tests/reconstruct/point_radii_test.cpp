// Radii of all rows, with bounded memory. What the radii are: tests/radii, tests/tools/radius_test.cpp.
#include "lamina/point_radii.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/temporary_folder.h"
#include "support/heap.h"

namespace lamina {
namespace {

/// A long strip of `count` points, made when they are asked for: as dense for any count, and rows of one place lie far
/// apart.
class Strip final : public PointSource {
 public:
  explicit Strip(std::uint64_t count) {
    info_.path = "strip";
    info_.count = count;
    info_.random_access = true;
  }
  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override {
    count = static_cast<std::size_t>(std::min<std::uint64_t>(count, info_.count - first));
    out.first = first;
    for (auto* axis : {&out.x, &out.y, &out.z}) axis->assign(count, 0);
    for (std::size_t i = 0; i < count; ++i) {
      const double along = static_cast<double>(first + i) * 0.6180339887498949;  // the golden ratio: evenly spread
      out.x[i] = (along - std::floor(along)) * static_cast<double>(info_.count);
      out.y[i] = static_cast<double>((first + i) * 7919 % 64) / 16;
    }
  }
};

/// Takes rows and keeps none.
class NoPoints final : public PointsWriter {
 public:
  NoPoints() : PointsWriter({.radius = "radius"}) {}
  void append(const SampleBatch& rows) override { rows_ += rows.size(); }
  void commit() override {}
};

/// Bytes the heap grows by, at most, while radii of that many rows are found.
std::size_t heap_of(std::uint64_t rows) {
  const test::TemporaryFolder folder;
  Strip source(rows);
  NoPoints writer;
  PointRadiiSettings settings;
  settings.memory = std::size_t{1} << 20;
  std::size_t most = test::heap_bytes();
  const std::size_t before = most;
  RunContext run;
  run.threads = 1;
  run.tmp_dir = folder.path();
  run.progress = [&](const Progress& progress) {
    if (progress.stage != "read") most = std::max(most, test::heap_bytes());  // the store has buffers for its buckets
  };
  EXPECT_EQ(write_point_radii(source, writer, settings, run).rows.written, rows);
  return most - before;
}

TEST(PointRadii, MemoryDoesNotGrowWithTheRows) {
  if (!test::heap_is_counted()) GTEST_SKIP() << "the heap is a sanitizer's";
  // Buckets of the store enough for both to fill the estimator's window.
  constexpr std::uint64_t kRows = 130'000;
  const std::size_t few = heap_of(kRows);
  const std::size_t many = heap_of(3 * kRows);
  EXPECT_LT(many, few + 2 * (2 * kRows)) << "less than two bytes for each row more: the store's list of its blocks";
}

}  // namespace
}  // namespace lamina

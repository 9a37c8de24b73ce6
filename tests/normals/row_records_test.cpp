// Normals on their way to their rows: the same in memory and by way of the disk.
#include "normals/row_records.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/temporary_folder.h"
#include "normals/row_normals.h"
#include "normals/sample_window.h"

namespace lamina::normals {
namespace {

constexpr std::size_t kRows = 40000;
constexpr std::uint32_t kNodes = 50;

std::array<float, 3> some_normal(std::mt19937& random) {
  std::normal_distribution<float> of_axis;
  std::array<float, 3> n{of_axis(random), of_axis(random), of_axis(random)};
  const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
  for (float& v : n) v /= length;
  return n;
}

/// Something of everything, rows out of order; every fifth row gets nothing.
struct Found {
  std::vector<std::uint64_t> rows;
  std::vector<RowRecord> records;
  PatchSigns signs;

  Found() {
    std::mt19937 random(1);
    for (std::size_t i = 0; i < kRows; ++i) {
      if (i % 5 != 4) rows.push_back(i);
    }
    std::shuffle(rows.begin(), rows.end(), random);
    for (const std::uint64_t row : rows) {
      const std::uint32_t node = row % 7 == 0 ? kNoNode : static_cast<std::uint32_t>(random() % kNodes);
      const std::array<NormalCode, 5> codes{kKeep, kTurn, kNoNormal, code_of({0, 0, 1}), code_of(some_normal(random))};
      records.emplace_back(codes[std::min<std::size_t>(random() % 12, 4)], node);
    }
    signs.sign.resize(kNodes);
    for (std::int8_t& s : signs.sign) s = random() % 2 == 0 ? std::int8_t{1} : std::int8_t{-1};
  }

  /// In three pieces.
  void add_to(RowRecords& all) const {
    for (std::size_t piece = 0; piece < 3; ++piece) {
      const std::size_t begin = piece * rows.size() / 3;
      const std::size_t count = (piece + 1) * rows.size() / 3 - begin;
      all.add(std::span(rows).subspan(begin, count), std::span(records).subspan(begin, count));
    }
  }
};

SampleBatch rows_from(std::uint64_t first, std::size_t count, bool with_normals) {
  SampleBatch batch;
  batch.first = first;
  batch.x.resize(count);
  batch.y.resize(count);
  batch.z.resize(count);
  if (!with_normals) return batch;
  batch.nx.assign(count, 0.6F);
  batch.ny.assign(count, 0.0F);
  batch.nz.assign(count, 0.8F);
  return batch;
}

TEST(RowRecords, AreTheSameInMemoryAndByWayOfTheDisk) {
  const test::TemporaryFolder folder;
  const Found found;
  RowRecords in_memory(kRows, kRows * sizeof(RowRecord), folder.path());
  RowRecords on_disk(kRows, kRows * sizeof(RowRecord) - 1, folder.path());
  ASSERT_FALSE(in_memory.on_disk());
  ASSERT_TRUE(on_disk.on_disk());
  found.add_to(in_memory);
  found.add_to(on_disk);
  const RowNormals a(in_memory, found.signs, kRows, folder.path(), {});
  const RowNormals b(on_disk, found.signs, kRows, folder.path(), {});
  for (const bool own : {false, true}) {
    for (const std::size_t first : {std::size_t{0}, std::size_t{777}, kRows - 3000}) {
      SampleBatch one = rows_from(first, 3000, own);
      SampleBatch other = one;
      a.apply(one);
      b.apply(other);
      EXPECT_EQ(one.nx, other.nx);
      EXPECT_EQ(one.ny, other.ny);
      EXPECT_EQ(one.nz, other.nz);
    }
  }
}

TEST(RowRecords, ComeToTheirRowsWithTheirSigns) {
  const test::TemporaryFolder folder;
  RowRecords records(6, 1000, folder.path());
  const std::vector<std::uint64_t> rows{5, 2, 0, 1, 4};
  const NormalCode up = code_of({0, 0, 1});
  records.add(rows, std::vector<RowRecord>{{up, 1}, {up, 2}, {kTurn, 2}, {kNoNormal, 2}, {up, kNoNode}});
  PatchSigns signs;
  signs.sign = {1, 1, -1};
  const RowNormals normals(records, signs, 6, folder.path(), {});
  SampleBatch batch = rows_from(0, 6, true);
  normals.apply(batch);
  EXPECT_EQ(batch.nz, (std::vector<float>{0.8F, 0, -1, 0.8F, 1, 1}));
  EXPECT_EQ(batch.nx, (std::vector<float>{0.6F, 0, 0, 0.6F, 0, 0}));
}

TEST(RowRecords, LeaveEveryRowAsItIsWhereThereAreNone) {
  const test::TemporaryFolder folder;
  RowRecords records(3, 1000, folder.path());
  const RowNormals normals(records, {}, 3, folder.path(), {});
  SampleBatch batch = rows_from(0, 3, true);
  normals.apply(batch);
  EXPECT_EQ(batch.nz, std::vector<float>(3, 0.8F));
}

}  // namespace
}  // namespace lamina::normals

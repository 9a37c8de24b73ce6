#include "lamina/memory_points.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "lamina/error.h"

namespace lamina {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(MemoryPoints, AreReadWhereTheyLieWhateverTheirStride) {
  const std::array<double, 6> positions{1, 2, 3, 4, 5, 6};
  const std::array<std::uint32_t, 2> ids{4294967295U, 7};  // last row first
  const double radius = 0.5;
  const std::ptrdiff_t row = 3 * sizeof(double);
  const auto source = view_points("arrays", 2,
                                  {{"x", ScalarType::float64, &positions[0], row},
                                   {"y", ScalarType::float64, &positions[1], row},
                                   {"z", ScalarType::float64, &positions[2], row},
                                   {"radius", ScalarType::float64, &radius, 0},
                                   {"id", ScalarType::uint32, &ids[1], -std::ptrdiff_t{sizeof(std::uint32_t)}}});
  EXPECT_EQ(source->info().count, 2U);
  EXPECT_TRUE(source->info().double_precision);
  EXPECT_TRUE(source->info().random_access);
  EXPECT_FALSE(source->info().has_normals);
  SampleBatch batch;
  source->read(0, 10, batch);
  EXPECT_THAT(batch.x, ElementsAre(1, 4));
  EXPECT_THAT(batch.z, ElementsAre(3, 6));
  EXPECT_THAT(batch.radius, ElementsAre(0.5F, 0.5F));
  EXPECT_THAT(batch.exact.at(0), ElementsAre(7, 4294967295.0));
  source->read(1, 1, batch);
  EXPECT_EQ(batch.first, 1U);
  EXPECT_THAT(batch.y, ElementsAre(5));
}

TEST(MemoryPoints, NeedPositions) {
  const float zero = 0;
  try {
    view_points("arrays", 1, {{"x", ScalarType::float32, &zero, 4}, {"y", ScalarType::float32, &zero, 4}});
    FAIL() << "no z";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ExitCode::unreadable);
    EXPECT_THAT(e.what(), HasSubstr("arrays"));
  }
}

TEST(PointSpool, GivesBackWhatCame) {
  PointSpool spool("spool", {.double_positions = true, .normals = true, .attributes = {{"id", ScalarType::uint32}}});
  constexpr std::size_t kRows = 3000;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (std::size_t first = 0; first < kRows; first += 1000) {
    SampleBatch batch;
    batch.attributes.resize(1);
    for (std::size_t i = first; i < first + 1000; ++i) {
      const auto v = static_cast<double>(i);
      batch.x.push_back(1e6 + v / 3), batch.y.push_back(i == 5 ? nan : -v), batch.z.push_back(0);
      batch.nx.push_back(0), batch.ny.push_back(0), batch.nz.push_back(1);
      batch.attributes[0].push_back(static_cast<float>(i));
    }
    spool.append(batch);
  }
  EXPECT_EQ(spool.rows(), kRows);
  const auto source = spool.finish();
  EXPECT_EQ(source->info().count, kRows);
  SampleBatch batch;
  source->read(1234, 2, batch);
  EXPECT_THAT(batch.x, ElementsAre(1e6 + 1234.0 / 3, 1e6 + 1235.0 / 3));
  EXPECT_THAT(batch.nz, ElementsAre(1, 1));
  EXPECT_THAT(batch.exact.at(0), ElementsAre(1234, 1235));
  source->read(5, 1, batch);
  EXPECT_TRUE(std::isnan(batch.y[0]));
  EXPECT_THROW(spool.append(batch), Error);
  EXPECT_THROW(spool.finish(), Error);
}

TEST(PointSpool, RefusesBatchesThatLackAnArray) {
  PointSpool spool("spool", {.normals = true});
  SampleBatch batch;
  batch.x = batch.y = batch.z = {1, 2};
  EXPECT_THROW(spool.append(batch), Error);
}

}  // namespace
}  // namespace lamina

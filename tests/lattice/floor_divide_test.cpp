#include "lattice/lattice.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace lamina {
namespace {

std::int64_t truth(std::int64_t value, std::int64_t divisor) {
  return value / divisor - (value % divisor != 0 && value < 0 ? 1 : 0);
}

TEST(FloorDivider, IsExactForEveryKindOfDivisor) {
  constexpr std::int32_t low = std::numeric_limits<std::int32_t>::min();
  constexpr std::int32_t high = std::numeric_limits<std::int32_t>::max();
  std::mt19937 random(1);
  for (const std::int32_t divisor : {1, 2, 3, 7, 10, 4096, 999'983, 1 << 30, high - 1, high}) {
    const FloorDivider divide(divisor);
    const auto check = [&](std::int64_t value) {
      if (value < low || value > high) return;
      ASSERT_EQ(divide(static_cast<std::int32_t>(value)), truth(value, divisor)) << value << " / " << divisor;
    };
    for (int i = 0; i < 20'000; ++i) {
      const auto value = static_cast<std::int32_t>(random());
      const std::int64_t multiple = truth(value, divisor) * divisor;  // where rounding would show
      for (const std::int64_t v : {std::int64_t{value}, multiple - 1, multiple, multiple + 1}) check(v);
    }
    for (const std::int64_t v : {std::int64_t{low}, std::int64_t{low} + 1, std::int64_t{high}, std::int64_t{0}})
      check(v);
  }
}

TEST(FloorDivider, CountsFromItsOrigin) {
  constexpr std::int32_t low = std::numeric_limits<std::int32_t>::min();
  constexpr std::int32_t high = std::numeric_limits<std::int32_t>::max();
  EXPECT_EQ(FloorDivider(1000, low)(low), 0);
  EXPECT_EQ(FloorDivider(1000, low)(low + 999), 0);
  EXPECT_EQ(FloorDivider(1000, low)(high), 4'294'967);
  EXPECT_EQ(FloorDivider(3, 10)(9), -1);
}

}  // namespace
}  // namespace lamina

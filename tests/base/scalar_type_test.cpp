#include "base/number.h"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>

namespace lamina {
namespace {

TEST(PlyType, BothFamiliesOfNamesAreKnown) {
  const char* const classic[] = {"char", "uchar", "short", "ushort", "int", "uint", "float", "double"};
  const char* const sized[] = {"int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"};
  for (int i = 0; i < 8; ++i) {
    const auto type = static_cast<ScalarType>(i);
    EXPECT_EQ(ply_name(type), classic[i]);
    EXPECT_EQ(ply_type(classic[i]), type);
    EXPECT_EQ(ply_type(sized[i]), type);
  }
  for (const char* other : {"", "half", "float16", "list", "Float"}) EXPECT_EQ(ply_type(other), std::nullopt);
}

TEST(ScalarType, ValuesAreRoundedAndClamped) {
  EXPECT_EQ(to_scalar<std::uint8_t>(2.5), 2);  // ties to even
  EXPECT_EQ(to_scalar<std::uint8_t>(3.5F), 4);
  EXPECT_EQ(to_scalar<std::uint8_t>(-1.0), 0);
  EXPECT_EQ(to_scalar<std::int16_t>(1e9), 32767);
  EXPECT_EQ(to_scalar<float>(0.1), 0.1F);
}

TEST(ScalarType, RangesAreThoseOfTheTypes) {
  EXPECT_EQ(scalar_range(ScalarType::int8).low, -128);
  EXPECT_EQ(scalar_range(ScalarType::uint32).high, 4294967295.0);
  EXPECT_EQ(scalar_range(ScalarType::float32).high, std::numeric_limits<double>::infinity());
}

TEST(ScalarType, BothByteOrdersAreRead) {
  const std::array bytes{std::byte{1}, std::byte{2}};
  EXPECT_EQ(load_scalar(ScalarType::uint16, false, bytes.data()), 0x0201);
  EXPECT_EQ(load_scalar(ScalarType::uint16, true, bytes.data()), 0x0102);
}

}  // namespace
}  // namespace lamina

#include "base/ply_type.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace lamina

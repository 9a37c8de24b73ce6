#include "points/point_columns.h"

#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "base/number.h"
#include "points/ply_files.h"

namespace lamina {
namespace {

TEST(PlyColumns, EveryTypeInBothOrdersAtAnyOffset) {
  std::mt19937 random(5);
  for (int t = 0; t < 8; ++t) {
    const auto type = static_cast<ScalarType>(t);
    for (const bool big : {false, true}) {
      std::vector<double> expected;
      std::string bytes;
      for (int i = 0; i < 50; ++i) {
        do expected.resize(static_cast<std::size_t>(i)), expected.push_back(test::random_value(type, random));
        while (std::isnan(expected.back()));
        bytes += "pad";
        test::put_binary(bytes, type, expected.back(), big);
      }
      const std::size_t stride = bytes.size() / 50;
      const auto* row = reinterpret_cast<const std::byte*>(bytes.data()) + 3;
      std::vector<double> wide(50);
      std::vector<float> narrow(50);
      convert_column(type, big, row, stride, 50, wide.data());
      convert_column(type, big, row, stride, 50, narrow.data());
      EXPECT_EQ(wide, expected) << t;
      EXPECT_EQ(narrow, std::vector<float>(expected.begin(), expected.end())) << t;
      if (t < 6) {
        EXPECT_EQ(load_scalar(type, big, row), expected[0]);
      }
    }
  }
}

}  // namespace
}  // namespace lamina

#include "mls/overhang.h"

#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>

namespace lamina {
namespace {

RC_GTEST_PROP(Lean, IsKeptWithinAThousandth, ()) {
  const auto component = [] { return static_cast<float>(*rc::gen::inRange(-1000, 1001)) / 1000.0F; };
  const std::array<float, 3> lean{component(), component(), component()};
  const std::array<float, 3> back = unpacked_lean(packed_lean(lean));
  for (std::size_t k = 0; k < 3; ++k) RC_ASSERT(std::abs(back[k] - lean[k]) <= 1.0F / 1000);
}

TEST(Lean, IsCutOffAtOneRadius) {
  const std::array<float, 3> back = unpacked_lean(packed_lean({3, -7, 0}));
  EXPECT_FLOAT_EQ(back[0], 1);
  EXPECT_FLOAT_EQ(back[1], -1);
  EXPECT_FLOAT_EQ(back[2], 0);
}

}  // namespace
}  // namespace lamina

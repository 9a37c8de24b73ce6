#include "lattice/block_mask.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>

namespace lamina {
namespace {

RC_GTEST_PROP(BlockMask, AxesGoWhereTheyAreSent, ()) {
  BlockMask mask;
  for (auto& w : mask.words) w = *rc::gen::arbitrary<std::uint64_t>();
  std::array<int, 3> to{0, 1, 2};
  do {
    const BlockMask turned = with_axes(mask, to);
    for (int at = 0; at < 512; ++at) {
      const std::array<int, 3> from{at & 7, at >> 3 & 7, at >> 6};
      std::array<int, 3> there{};
      for (std::size_t k = 0; k < 3; ++k) there[static_cast<std::size_t>(to[k])] = from[k];
      RC_ASSERT(turned.test(BlockMask::offset(there[0], there[1], there[2])) == mask.test(at));
    }
  } while (std::next_permutation(to.begin(), to.end()));
}

}  // namespace
}  // namespace lamina

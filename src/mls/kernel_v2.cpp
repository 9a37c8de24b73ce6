// The projection kernel for x86-64-v2 processors (flags set in src/CMakeLists.txt).
#include <smmintrin.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "mls/kernel.h"

namespace lamina::kernel_v2 {
namespace {
#include "mls/kernel_source.h"
}  // namespace

Kernel kernel() {
  return {"x86-64-v2", &accumulate, &accumulate_facing, &accumulate_sheet, &accumulate_moments, &fit, &extend};
}

}  // namespace lamina::kernel_v2

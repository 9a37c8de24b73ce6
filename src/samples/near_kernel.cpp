#include "samples/near_kernel.h"

#include <array>
#include <cstddef>

#include "base/processor.h"

namespace lamina {

namespace {

constexpr std::array<const NearKernel*, 3> kNearKernels{&near_v2::kKernel, &near_v3::kKernel, &near_v4::kKernel};

}  // namespace

const NearKernel& near_kernel() {
  return *kNearKernels.at(static_cast<std::size_t>(wanted_kind()));
}

std::vector<const NearKernel*> available_near_kernels() {
  return {kNearKernels.begin(), kNearKernels.begin() + static_cast<std::ptrdiff_t>(processor_kind()) + 1};
}

}  // namespace lamina

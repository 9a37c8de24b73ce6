#include "mls/kernel.h"

#include "base/processor.h"

namespace lamina {

void TileSamples::resize(std::size_t n, std::size_t attribute_count) {
  all.resize(n);
  for (std::vector<float>* v : {&x, &y, &z, &inv_support2}) v->resize(n + kLanes);
  attributes.resize(attribute_count);
  for (std::vector<float>& a : attributes) a.resize(n);
}

std::vector<Kernel> available_kernels() {
  const ProcessorKind own = processor_kind();
  std::vector<Kernel> kernels{kernel_v2::kernel()};
  if (own >= ProcessorKind::v3) kernels.push_back(kernel_v3::kernel());
  if (own >= ProcessorKind::v4) kernels.push_back(kernel_v4::kernel());
  return kernels;
}

Kernel select_kernel() {
  switch (wanted_kind()) {
    case ProcessorKind::v2:
      return kernel_v2::kernel();
    case ProcessorKind::v3:
      return kernel_v3::kernel();
    case ProcessorKind::v4:
      break;
  }
  return kernel_v4::kernel();
}

}  // namespace lamina

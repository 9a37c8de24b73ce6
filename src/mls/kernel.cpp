#include "mls/kernel.h"

#include <algorithm>
#include <cstdlib>
#include <string>
#include <string_view>

#include "lamina/error.h"

namespace lamina {

void TileSamples::resize(std::size_t n, std::size_t attribute_count) {
  all.resize(n);
  for (std::vector<float>* v : {&x, &y, &z, &inv_support2}) v->resize(n + kLanes);
  attributes.resize(attribute_count);
  for (std::vector<float>& a : attributes) a.resize(n);
}

std::vector<Kernel> available_kernels() {
  __builtin_cpu_init();
  std::vector<Kernel> kernels{kernel_v2::kernel()};
  bool v3 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi") &&
            __builtin_cpu_supports("bmi2");
#ifndef __clang__  // which knows no names for the rest of v3 before its version 19
  v3 = v3 && __builtin_cpu_supports("f16c") && __builtin_cpu_supports("movbe");
#endif
  if (v3) kernels.push_back(kernel_v3::kernel());
  const bool v4 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                  __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
                  __builtin_cpu_supports("avx512vl");
  if (v3 && v4) kernels.push_back(kernel_v4::kernel());
  return kernels;
}

Kernel select_kernel() {
  const std::vector<Kernel> kernels = available_kernels();
  const char* wanted = std::getenv("LAMINA_KERNEL");
  if (wanted == nullptr || *wanted == '\0') return kernels.back();
  for (const Kernel& k : kernels) {
    if (std::string_view(k.name).ends_with(wanted)) return k;
  }
  throw Error(ExitCode::usage, "LAMINA_KERNEL=" + std::string(wanted) +
                                   ": no such kernel on this processor; leave it unset or name one of v2, v3, v4");
}

}  // namespace lamina

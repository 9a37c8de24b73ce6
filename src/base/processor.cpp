#include "base/processor.h"

#include <array>
#include <cstdlib>
#include <string>
#include <string_view>

#include "lamina/error.h"

namespace lamina {

ProcessorKind processor_kind() {
  __builtin_cpu_init();
  bool v3 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi") &&
            __builtin_cpu_supports("bmi2");
#ifndef __clang__  // which knows no names for the rest of v3 before its version 19
  v3 = v3 && __builtin_cpu_supports("f16c") && __builtin_cpu_supports("movbe");
#endif
  const bool v4 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                  __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
                  __builtin_cpu_supports("avx512vl");
  if (v3 && v4) return ProcessorKind::v4;
  return v3 ? ProcessorKind::v3 : ProcessorKind::v2;
}

ProcessorKind wanted_kind() {
  const ProcessorKind own = processor_kind();
  const char* wanted = std::getenv("LAMINA_KERNEL");
  if (wanted == nullptr || *wanted == '\0') return own;
  constexpr std::array<std::string_view, 3> kKindNames{"v2", "v3", "v4"};
  for (std::size_t i = 0; i <= static_cast<std::size_t>(own); ++i) {
    if (kKindNames[i].ends_with(wanted)) return static_cast<ProcessorKind>(i);
  }
  throw Error(ExitCode::usage, "LAMINA_KERNEL=" + std::string(wanted) +
                                   ": no such kernel on this processor; leave it unset or name one of v2, v3, v4");
}

}  // namespace lamina

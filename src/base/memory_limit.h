// Jobs refused before they begin to take more memory than they may.
#pragma once
#include <cstdint>
#include <string>

#include "lamina/run.h"

namespace lamina {

/// Throws Error(budget), saying what would do, where `needed` bytes are more than run.max_memory. `what`: "sorting".
void require_memory(const RunContext& run, std::uint64_t needed, const std::string& name, const std::string& what);

/// Bytes of memory that the machine has; 0 when it does not say.
std::uint64_t machine_memory();

}  // namespace lamina

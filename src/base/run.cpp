#include "base/run.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>

#include "lamina/error.h"
#include "lamina/run.h"

namespace lamina {

void require_memory(const RunContext& run, std::uint64_t needed, const std::string& name, const std::string& what) {
  if (run.max_memory == 0 || needed <= run.max_memory) return;
  constexpr double kMega = 1 << 20;  // as --max-memory reads it
  throw Error(ExitCode::budget,
              fmt::format("{}: {} needs about {:.0f}M of memory, --max-memory allows {:.0f}M; give it more", name, what,
                          std::ceil(static_cast<double>(needed) / kMega), static_cast<double>(run.max_memory) / kMega));
}

std::uint64_t machine_memory() {
  const long pages = sysconf(_SC_PHYS_PAGES), bytes = sysconf(_SC_PAGESIZE);
  return pages > 0 && bytes > 0 ? static_cast<std::uint64_t>(pages) * static_cast<std::uint64_t>(bytes) : 0;
}

std::string_view version() {
  return LAMINA_VERSION;
}

}  // namespace lamina

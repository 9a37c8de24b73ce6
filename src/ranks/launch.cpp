#include <array>
#include <charconv>
#include <cstdlib>
#include <optional>
#include <string_view>
#include <utility>

#include "lamina/ranks.h"

namespace lamina {

namespace {

std::optional<int> number_in(const char* variable) {
  const char* const text = std::getenv(variable);
  if (text == nullptr) return std::nullopt;
  const std::string_view digits(text);
  int value = 0;
  const auto [end, bad] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (bad != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
  return value;
}

}  // namespace

Launch launch() {
  // Open MPI's mpirun; MPICH's and Intel's; Slurm's srun, where it speaks PMIx.
  static constexpr std::array<std::pair<const char*, const char*>, 3> kVariables{
      {{"OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"},
       {"PMI_SIZE", "PMI_RANK"},
       {"SLURM_STEP_NUM_TASKS", "PMIX_RANK"}}};
  for (const auto& [size, rank] : kVariables) {
    const std::optional<int> processes = number_in(size), own = number_in(rank);
    if (processes && own && *processes > 1 && *own >= 0 && *own < *processes) return {*own, *processes};
  }
  return {};
}

}  // namespace lamina

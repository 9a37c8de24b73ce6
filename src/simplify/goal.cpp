#include "simplify/goal.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "lamina/error.h"

namespace lamina::simplify {

void require_goal(const SimplifySettings& s) {
  const int given =
      (s.triangles > 0 ? 1 : 0) + (s.error != 0 ? 1 : 0) + (s.ratio != 0 ? 1 : 0) + (s.deviation != 0 ? 1 : 0);
  if (s.error != 0 && !(s.error > 0 && std::isfinite(s.error)))
    throw Error(ExitCode::usage, fmt::format("simplify: an error of {:g}: a length above 0 is meant", s.error));
  if (s.ratio != 0 && !(s.ratio > 0 && s.ratio <= 1))
    throw Error(ExitCode::usage,
                fmt::format("simplify: a ratio of {:g}: a share above 0 and up to 1 is meant", s.ratio));
  if (s.deviation != 0 && !(s.deviation > 0 && s.deviation <= 1)) {
    throw Error(ExitCode::usage,
                fmt::format("simplify: a deviation of {:g}: lengths of an edge above 0 and up to 1 are "
                            "meant",
                            s.deviation));
  }
  if (given == 0) throw Error(ExitCode::usage, "simplify: at least one triangle has to stay");
  if (given > 1)
    throw Error(ExitCode::usage, "simplify: one of a number of triangles, a ratio, an error and a deviation, not both");
}

std::uint64_t wanted_triangles(const SimplifySettings& settings, std::uint64_t there) {
  if (settings.error > 0 || settings.deviation > 0) return 0;
  if (settings.ratio > 0)
    return static_cast<std::uint64_t>(std::max(1.0, std::floor(settings.ratio * static_cast<double>(there))));
  if (settings.triangles > there) {
    throw Error(ExitCode::usage,
                fmt::format("simplify: {} triangles are wanted, the mesh has {}", settings.triangles, there));
  }
  return settings.triangles;
}

SimplifySettings goal_for(const SimplifySettings& settings, std::uint64_t there, const RunContext& run) {
  if (settings.triangles <= there) return settings;
  run.warn(fmt::format("the mesh has {} triangles, no more than the {} that were wanted: it stays as it is", there,
                       settings.triangles));
  return {.ratio = 1};
}

}  // namespace lamina::simplify

// What is said about normals that were found.
#include <fmt/format.h>

#include <algorithm>

#include "lamina/normals.h"

namespace lamina {
namespace {

double percent(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? 0.0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

}  // namespace

std::size_t NormalsReport::worst_slab() const {
  // A few links say nothing.
  constexpr std::uint64_t kEnough = 1000;
  std::size_t worst = 0;
  double share = -1;
  for (std::size_t i = 0; i < slabs.size(); ++i) {
    if (slabs[i].pairs < std::min(kEnough, conflicts.pairs) || slabs[i].share() <= share) continue;
    share = slabs[i].share();
    worst = i;
  }
  return worst;
}

std::string describe(const NormalsReport& r) {
  std::string text = fmt::format("{} normals found", r.estimated);
  if (r.flipped > 0) text += fmt::format(", {} turned", r.flipped);
  if (r.without > 0) text += fmt::format(", {} samples without one", r.without);
  if (r.by_viewpoint > 0) text += fmt::format("; {:.1f} % face a viewpoint", percent(r.by_viewpoint, r.samples));
  if (r.by_given > 0) text += fmt::format("; {:.1f} % follow given ones", percent(r.by_given, r.samples));
  if (r.by_outside > 0) {
    text += fmt::format("; {:.1f} % face outside of what they enclose", percent(r.by_outside, r.samples));
    if (r.unsure > 0) text += fmt::format(" ({:.1f} % enclose little)", percent(r.unsure, r.samples));
  }
  return text + fmt::format("; {:.2f} % of neighbours conflict", 100 * r.conflicts.share());
}

void warn_of_conflicts(const NormalsReport& r, const std::string& path, const RunContext& run) {
  constexpr double kMuch = 0.02;  // scans of thin things have a percent
  constexpr double kUnsure = 0.2;
  const SignConflicts worst = r.slabs.empty() ? SignConflicts{} : r.slabs[r.worst_slab()];
  if (r.conflicts.share() > kMuch || worst.share() > 4 * kMuch) {
    run.warn(
        fmt::format("{}: the normals of {:.1f} % of neighbouring samples point to opposite sides, {:.1f} % in slab "
                    "{} of {}: expect holes and double sheets; a viewpoint, an up direction or a larger k may help",
                    path, 100 * r.conflicts.share(), 100 * worst.share(), r.worst_slab() + 1, r.slabs.size()));
  }
  if (static_cast<double>(r.unsure) > kUnsure * static_cast<double>(r.samples)) {
    run.warn(
        fmt::format("{}: {:.0f} % of the samples lie on surfaces too flat or open to tell their outside: say where "
                    "it is with --viewpoint or --up",
                    path, percent(r.unsure, r.samples)));
  }
}

}  // namespace lamina

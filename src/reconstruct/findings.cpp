#include "reconstruct/findings.h"

#include <fmt/format.h>

namespace lamina {
namespace {

/// A stretch is worth naming where it has so many times the usual noise.
constexpr double kMuchNoisier = 1.5;

std::string scans_text(const SurfaceStats& stats) {
  const SurfacePlan& plan = stats.plan;
  if (plan.scans < 2) return "";
  std::string text = fmt::format(" of {} scans", plan.scans);
  if (plan.overlap > 0) text += fmt::format(" that share {:.0f} % of the places", 100 * plan.overlap);
  const ScanAlignment& a = stats.alignment;
  if (a.moved()) text += fmt::format(", moved by up to {:.2g} and now {:.2g} apart", a.farthest, a.after);
  return text;
}

std::string noise_text(const SurfacePlan& plan) {
  std::string text = fmt::format("noise {:.2g} r, a tenth above {:.2g} r", plan.noise, plan.high_noise);
  if (plan.worst_noise > kMuchNoisier * plan.noise) {
    const auto& [x, y, z] = plan.noisiest;
    text += fmt::format(", {:.2g} r around {:.4g},{:.4g},{:.4g}", plan.worst_noise, x, y, z);
  }
  return text;
}

std::string normals_text(const SurfaceStats& stats) {
  std::string text = stats.normals ? "normals found" : "normals of the file";
  text += fmt::format(", {:.2g} degrees off the surface", stats.plan.normal_noise);
  if (stats.plan.sharpen)
    text += fmt::format(", {:.2g} % interpolated over sharp edges", 100 * stats.plan.blurred_normals);
  return text;
}

std::string seen(const SurfaceStats& stats) {
  const SurfacePlan& plan = stats.plan;
  // Density radii are twice the spacing.
  std::string text = fmt::format("seen: {} samples{}, spacing {:.3g} ({:.3g} to {:.3g}); {}; {}", plan.samples,
                                 scans_text(stats), plan.radius_median / 2, plan.radius_low / 2, plan.radius_high / 2,
                                 noise_text(plan), normals_text(stats));
  const std::uint64_t strays = stats.cleaned.lonely + stats.cleaned.off_surface;
  if (strays > 0) {
    text += fmt::format("; {} strays ({:.2g} %) left out", strays,
                        100.0 * static_cast<double>(strays) / static_cast<double>(plan.samples + strays));
  }
  return text;
}

/// As options, those that were not given.
std::string chosen(const SurfaceSettings& s, const SurfacePlan& plan) {
  std::string text;
  const auto add = [&](bool open, const std::string& option) {
    if (open) text += " " + option;
  };
  add(!s.blend, fmt::format("--blend {:g}", plan.blend));
  add(!s.blend && !s.cell, fmt::format("--cell {}{}", to_string(plan.cell),
                                       plan.refine_sheets ? " (half of it where things are thin)" : ""));
  add(!s.refit && !s.blend, fmt::format("--refit {:g}", plan.refit));
  add(!s.trim && !s.blend, fmt::format("--trim {:g}", plan.trim));
  add(!s.features && !s.blend, fmt::format("--features {}{}", plan.features ? "yes" : "no",
                                           plan.sharpen ? " (and normals found again at edges)" : ""));
  add(!s.close_holes, fmt::format("--close-holes {:g}", plan.longest_rim));
  add(!s.watertight && !s.blend, fmt::format("--watertight {}", plan.watertight ? "yes" : "no"));
  add(!s.bridge && !s.blend, fmt::format("--bridge {}", plan.bridge ? "yes" : "no"));
  add(!s.deviation && !s.simplify.wanted(), fmt::format("--deviation {:g}", plan.deviation));
  return text.empty() ? text : "\nchosen:" + text;
}

}  // namespace

std::string describe_findings(const SurfaceSettings& settings, const SurfaceStats& stats) {
  return seen(stats) + chosen(settings, stats.plan);
}

}  // namespace lamina

// The plan in words and pictures, for a reader.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <string>

#include "reconstruct/plan.h"
#include "reconstruct/stages.h"

namespace lamina {
namespace {

/// No more exact than the model: seconds below a minute and a half, then minutes, then hours.
std::string about(double seconds) {
  if (seconds < 10) return fmt::format("{:.1f} s", seconds);
  if (seconds < 90) return fmt::format("{:.0f} s", seconds);
  if (seconds < 5400) return fmt::format("{:.0f} min", seconds / 60);
  return fmt::format("{:.1f} h", seconds / 3600);
}

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

std::string describe(const SurfacePlan& p) {
  const auto mb = [](std::uint64_t bytes) { return static_cast<double>(bytes) / 1e6; };
  std::string out;
  out += fmt::format("samples {}, extent {:.4g} x {:.4g} x {:.4g}\n", p.samples, p.extent[0], p.extent[1], p.extent[2]);
  out += fmt::format("radius r {:.4g} (1 % {:.4g}, 99 % {:.4g}), influence R = {:g} r\n", p.radius_median, p.radius_low,
                     p.radius_high, p.blend);
  out += fmt::format("levels {}, cells {:.4g} to {:.4g}, slabs {} of {:.4g}\n", p.levels, p.finest_cell,
                     std::ldexp(p.finest_cell, p.levels - 1), p.slabs, p.slab_height);
  out += fmt::format("expected memory {:.0f} MB, temporary disk {:.0f} MB", mb(p.memory_bytes), mb(p.disk_bytes));
  if (p.seconds > 0) {
    out += fmt::format(", about {} on {} thread{}", about(p.seconds), p.threads, p.threads == 1 ? "" : "s");
  }
  return out;
}

std::string describe_findings(const SurfaceSettings& settings, const SurfaceStats& stats) {
  return seen(stats) + chosen(settings, stats.plan);
}

std::string draw_stages() {
  constexpr int kFarthest = reach_of(Stage::mark).ahead, kWidth = 6;
  const auto slab = [](int offset) { return offset == 0 ? std::string("t") : fmt::format("t{:+}", offset); };
  std::string out = fmt::format("{:<12}", "slab");
  const auto end_line = [&] {
    while (out.back() == ' ') out.pop_back();
    out += '\n';
  };
  for (int s = 0; s <= kFarthest; ++s) out += fmt::format("{:^{}}", slab(s), kWidth);
  end_line();
  for (const StageReach& stage : kStageReach) {
    out += fmt::format("{:<12}", stage.name);
    for (int s = 0; s <= stage.ahead; ++s) out += fmt::format("{:^{}}", s == stage.ahead ? "#" : "=", kWidth);
    end_line();
  }
  return out;
}

}  // namespace lamina

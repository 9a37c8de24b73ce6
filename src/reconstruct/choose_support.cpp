#include "reconstruct/choose_support.h"

#include <fmt/format.h>

#include <algorithm>

namespace lamina {
namespace {

/// Samples this far (radii) from the surface that their neighbours suggest are noisy. Detail that the sampling hardly
/// resolves looks the same up to 0.05; noise of half a spacing either way has 0.12.
constexpr float kNoisy = 0.05F;
constexpr float kVeryNoisy = 0.1F;

/// Radii of an evenly sampled surface: the 99 % quantile is some 2.5 times the 1 % one (cells that the surface clips
/// give long ones), six to eight where density varies 64 times. Where density varies, the support must bridge wider
/// gaps.
constexpr float kEven = 3;

/// No more than 1.3 M triangles of a million samples.
constexpr double kCell = 0.892;

}  // namespace

SupportChoice choose_support(const SurfaceSettings& settings, const RadiusSurvey& survey) {
  SupportChoice out;
  if (settings.blend) {
    out.blend = *settings.blend;
  } else if (survey.noise > kNoisy) {
    const double share =
        std::min(1.0, static_cast<double>(survey.noise - kNoisy) / static_cast<double>(kVeryNoisy - kNoisy));
    out.blend = 1.75 + 0.75 * share;
    out.cell = {kCell, Length::Unit::sample_radius};
    out.refit = 4;
    if (!settings.cell) out.band = 1.25F;
    out.good_reach = 0.2F;
  } else if (survey.high < kEven * survey.low) {
    out.blend = 1;
    out.cell = {kCell, Length::Unit::sample_radius};
    out.good_reach = 0.25F;
    out.good_samples = 4;
    out.watertight = true;
    if (!settings.cell) {
      // Around thin things cells are half as large: values must reach over as many more of them.
      out.thin_cells = true;
      out.band = 4;
    }
  }
  if (settings.cell) out.cell = *settings.cell;
  if (settings.watertight) out.watertight = *settings.watertight;
  if (settings.refit) out.refit = *settings.refit;
  return out;
}

HoleSettings hole_settings(const SurfaceSettings& settings, const SupportChoice& support) {
  // Free clustering joins sheets: a rim may pass through a vertex several times.
  const double longest = settings.cluster == ClusterMode::free ? 0 : settings.close_holes;
  return {longest, support.watertight && longest > 0};
}

std::string describe_choice(const SurfaceSettings& settings, const SurfacePlan& plan) {
  if (settings.blend) return "";
  return fmt::format("noise {:.2g} r: chosen --blend {:g} --cell {}{} --refit {:g}{}", plan.noise, plan.blend,
                     to_string(plan.cell), plan.thin_cells ? " (half of it where things are thin)" : "", plan.refit,
                     plan.watertight ? " --watertight yes" : "");
}

}  // namespace lamina

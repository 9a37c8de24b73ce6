#include "reconstruct/plan.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "reconstruct/constants.h"
#include "samples/consensus_plane.h"

namespace lamina {
namespace {

/// Where corners themselves say how many projections they need.
constexpr int kMostProjections = 16;

/// Where rims of noisy clouds are cut.
double rim_overhang(double blend) {
  constexpr double kStep = 1e-4;  // so that what is told as an option gives the same mesh
  const double wanted = kRimOverhang - kRimOverhangPerBlend * std::max(0.0, blend - kRimBlend);
  return kStep * std::round(wanted / kStep);
}

/// The largest leaf cell (sample radii) where triangles do not go for flatness: `s` wants some number of them, or all.
double unthinned_cell(const SurfaceSettings& s, std::uint64_t samples) {
  if (s.simplify.triangles == 0) return kChosenCell;
  constexpr double kStep = 1e-4;  // so that what is told as an option gives the same mesh
  const double full = kFullForWanted * static_cast<double>(s.simplify.triangles);
  const double main = std::sqrt(triangles_per_cell(s.cluster) * kSampleArea * static_cast<double>(samples) / full);
  return std::clamp(kStep * std::round(main / kMainCell / kStep), kFinestCell, kChosenCell);
}

void follow_places(const SupportSurvey& survey, ReconstructionPlan& plan) {
  plan.feed.support = std::make_shared<const SupportField>(survey.places);
  plan.feed.blend = static_cast<double>(plan.feed.support->median());
}

/// What noise asks for: supports as wide as it is at each place, and normals that agree.
void choose_for_noise(const CloudSurvey& survey, const SurfaceSettings& s, double cell, ReconstructionPlan& plan) {
  plan.feed.blend = kNoisyBlend;
  if (!survey.support.places.empty()) follow_places(survey.support, plan);
  const bool rough = static_cast<double>(survey.radii.normal_noise) * 180 / std::numbers::pi > kRoughNormals;
  plan.refit.by_place = plan.feed.support;
  plan.refit.per_blend = rough ? kRoughRefitPerBlend : kRefitPerBlend;
  plan.refit.support = static_cast<double>(plan.refit.per_blend) * plan.feed.blend;
  plan.feed.cell = {cell, Length::Unit::sample_radius};
  plan.trim = rim_overhang(plan.feed.blend);
  plan.settle_normals = true;
  if (s.cell && s.cell->unit != Length::Unit::sample_radius) return;
  plan.feed.band_cells = kNoisyBand;
  plan.feed.band_radii = kNoisyReach;
}

/// What an even, clean sampling allows: the narrowest support, and finer cells between sheets.
void choose_for_even(bool cell_given, double cell, ReconstructionPlan& plan) {
  plan.feed.blend = 1;
  plan.feed.cell = {cell, Length::Unit::sample_radius};
  plan.projection.trusted_offset = kEvenTrust;
  plan.projection.trusted_samples = kEvenTrustedSamples;
  plan.projection.height = kEvenHeight;
  if (cell_given) return;
  plan.feed.refine_sheets = true;
  plan.feed.band_cells = kSheetBand;
}

/// What lines of samples far apart ask for: supports that reach from one to the next, and cells that are found in the
/// middle between two.
void choose_for_lines(const SupportSurvey& survey, ReconstructionPlan& plan) {
  plan.lines = true;
  if (plan.feed.support == nullptr) follow_places(survey, plan);
  plan.feed.cell = {kLinesCell, Length::Unit::influence_radius};
  plan.feed.band_cells = FeedSettings{}.band_cells;
  plan.feed.band_radii = FeedSettings{}.band_radii;
  // Normals were found across lines, and a support may hold one alone.
  plan.refit.support = 0;
  plan.refit.by_place = nullptr;
}

}  // namespace

bool is_noisy(const RadiusSurvey& radii, const SupportSurvey& support) {
  return radii.noise > kNoisy || (radii.noise > kPerhapsNoisy && support.median() > kNoiseSupport);
}

double choose_deviation(const RadiusSurvey& survey) {
  constexpr double kStep = 1e-4;  // so that what is told as an option gives the same mesh
  const double wanted = kCleanDeviation + kNoiseDeviation * static_cast<double>(survey.noise);
  return kStep * std::round(std::min(wanted, kMostDeviation) / kStep);
}

void choose_support(const SurfaceSettings& s, const CloudSurvey& survey, const PointSourceInfo& info,
                    ReconstructionPlan& plan) {
  const RadiusSurvey& radii = survey.radii;
  const bool thins = !s.simplify.wanted() && s.deviation.value_or(kCleanDeviation) > 0;
  const double unthinned = unthinned_cell(s, plan.samples);
  plan.feed.blend = kDefaultBlend;
  if (s.blend) {
    plan.feed.blend = *s.blend;
  } else if (survey.noisy) {
    choose_for_noise(survey, s, thins ? kNoisyCell : unthinned, plan);
  } else if (radii.high < kEven * radii.low && !survey.support.lines) {
    choose_for_even(s.cell.has_value(), thins && radii.noise <= kSharp ? kThinnedCell : unthinned, plan);
    // A closed mesh. Normals come with samples of a surface, which ends where they do; positions alone say nothing of
    // wide gaps among them.
    plan.holes.watertight = info.found_normals ? Watertight::any_loops : Watertight::short_loops;
  }
  if (survey.support.lines) choose_for_lines(survey.support, plan);
  if (!s.blend && !survey.noisy) plan.trim = kCleanRimOverhang;
  if (s.trim) plan.trim = *s.trim;
  // Rims that are cut where the samples end may run on before.
  if (plan.trim > 0 && survey.noisy) plan.doubtful = DoubtfulPoints::as_extended;
  if (s.cell) plan.feed.cell = *s.cell;
  if (s.refit) {
    plan.refit.support = *s.refit;
    plan.refit.by_place = nullptr;
  }
  plan.projection.creases =
      s.features.value_or(!s.blend && !survey.noisy && radii.noise <= kSharp && !plan.lines) && !s.diffuse;
  if (plan.projection.creases && !s.refit && radii.noise <= kExact && radii.blurred > kBlurred) {
    plan.refit.support = double{kConsensusReach};
    plan.refit.only_blurred = true;
  }
  plan.projection.residuals = plan.refit.support > 0 && !plan.refit.only_blurred;
  // Free clustering joins sheets: a boundary loop may pass through a vertex several times.
  plan.holes.longest = s.cluster == ClusterMode::free ? 0 : s.close_holes.value_or(kLongestRim);
  plan.holes.mark = s.vertex_filled;
  plan.holes.all = s.fill_all;
  if (s.watertight) plan.holes.watertight = *s.watertight ? Watertight::any_loops : Watertight::no;
  // What is clean and has normals was mostly taken from a surface, which ends where it does.
  plan.holes.bridge = s.bridge.value_or(!s.blend && (survey.noisy || info.found_normals || tells_scans(info)));
  if (plan.holes.longest == 0) {
    plan.holes.watertight = Watertight::no;
    plan.holes.bridge = false;
  }
  plan.feed.radius_scale = static_cast<float>(s.radius_scale);
  plan.projection.fit = s.fit == FitMode::sphere ? Fit::sphere : Fit::plane;
  plan.projection.steps = s.steps == 0 ? kMostProjections : s.steps;
  if (s.steps == 0) plan.projection.tolerance = static_cast<float>(s.step_tolerance / plan.feed.blend);
  plan.projection.centres = s.diffuse;
}

}  // namespace lamina

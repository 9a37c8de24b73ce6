#include "surface/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "lamina/error.h"
#include "volume/surface_volume.h"

namespace lamina {
namespace {

constexpr std::uint64_t kSurveySamples = 1u << 18;  ///< samples whose radii are looked at before streaming
/// The size of most cells in units of the largest the median radius allows: with 0.64 the radii of an evenly sampled
/// surface (which scatter by 0.75 to 1.25 around their median) all ask for the same level.
constexpr double kMainCell = 0.7;
constexpr int kDefaultLevels = 4;
constexpr int kMaxLevels = 12;
constexpr std::int32_t kMinSteps = 64;  ///< fixed-point steps a finest cell must have for exact enough positions
constexpr double kMaxCells = 1 << 20;   ///< finest cells from the origin, the limit of the lattice's keys

[[noreturn]] void usage(const std::string& message) {
  throw Error(ExitCode::usage, message);
}

void require(bool ok, const char* option, const char* range) {
  if (!ok) usage(fmt::format("{} must be {}", option, range));
}

struct Levels {
  double finest;  ///< cell, steps
  int count;
};

/// Main cells follow the median radius; levels are added below for the 1 % smallest and above for the 1 % largest.
Levels choose_levels(const SurfaceSettings& s, double ratio, const RadiusSurvey& radii) {
  const double main = kMainCell * ratio * radii.median;
  const int finer = std::max(0, static_cast<int>(std::ceil(std::log2(main / (ratio * radii.low)) - 1e-9)));
  const int coarser = std::max(0, static_cast<int>(std::floor(std::log2(ratio * radii.high / main))));
  const int count = s.levels > 0 ? s.levels : std::clamp(finer + coarser + 1, kDefaultLevels, kMaxLevels);
  return {std::ldexp(main, -std::min(finer, count - 1)), count};
}

/// Counting cells of 16 samples are four spacings, two radii wide: the finest begin at half of that for the finest
/// cells' radius, and the coarsest serve the radius of the coarsest cells.
void set_counting_cells(const SurfaceSettings& s, const RadiusSurvey& survey, Resolved& out) {
  constexpr double kHalfWidth = 1.15;
  out.radii.min_samples = s.density;
  double finest_radius = survey.low;
  out.radii.levels = out.lattice.levels + 1;
  if (out.feed.fixed_cell) {
    const double octaves = std::log2(std::max(1.0F, survey.high / survey.low));
    out.radii.levels = std::clamp(static_cast<int>(std::ceil(octaves)) + 4, 4, kMaxLevels);
  } else {
    const double blend = out.feed.cell_follows_support ? s.blend : 1.0;
    finest_radius = out.lattice.cell / (kMainCell * out.feed.cell_ratio * blend);
  }
  const double cell = kHalfWidth * std::sqrt(s.density / 16.0) * finest_radius / s.radius_scale;
  out.radii.finest_cell = static_cast<std::int32_t>(std::clamp(std::lrint(cell), 1L, 1L << 24));
}

/// Faces wait on disk for the vertices. A sample stands for a quarter of its radius squared of surface; a main cell's
/// worth of surface gives some 3.3 triangles (the cells it cuts, two each), clustering leaves 55 % of them.
std::uint64_t expected_face_bytes(const SurfaceSettings& s, const Resolved& r, const RadiusSurvey& survey,
                                  std::uint64_t samples) {
  constexpr double kFaceBytes = 13;
  const double ratio = r.feed.cell_ratio * (r.feed.cell_follows_support ? s.blend : 1.0);
  const double finest = r.lattice.cell;
  const double cell = r.feed.fixed_cell ? finest : std::max(finest, kMainCell * ratio * survey.median);
  const double cells = static_cast<double>(samples) * 0.25 * survey.median * survey.median / (cell * cell);
  return static_cast<std::uint64_t>(kFaceBytes * cells * (s.cluster == ClusterMode::none ? 3.3 : 1.8));
}

std::uint64_t expected_memory(const SurfaceSettings& s, const Resolved& r, const SlabStore& store,
                              std::size_t attributes) {
  // The densest slab, from the store's own counts.
  double per_step = 0;
  for (std::size_t b = 0; b < store.buckets(); ++b) {
    if (store.count(b) == 0) continue;
    per_step = std::max(per_step, static_cast<double>(store.count(b)) /
                                      static_cast<double>(std::int64_t{store.z_upper(b)} - store.z_lower(b) + 1));
  }
  const double per_slab = std::min(per_step * r.lattice.slab_height(), static_cast<double>(store.total()));
  // A sample stands for a quarter of its radius squared of surface; around each cell of surface lie some four and a
  // half corners, and one and a half cells cross it. Coefficients: docs/performance.md.
  const double main_cell = kMainCell * r.feed.cell_ratio * (r.feed.cell_follows_support ? s.blend : 1.0);
  const double cells = r.feed.fixed_cell ? 1.0 : 0.25 / (main_cell * main_cell);
  const double corner_bytes =
      4.5 * cells * (4.0 * (static_cast<double>(kFirstAttribute) + static_cast<double>(attributes)) + 12);
  const double surface_bytes = 1.5 * cells * (56 + 4.0 * static_cast<double>(attributes) + 2 * 12 + 1.5 * 16);
  const double window = per_slab * ((3.0 + s.window) * corner_bytes + (5.0 + s.window) * surface_bytes);
  const double cached = std::min(static_cast<double>(r.feed.cache_bytes),
                                 static_cast<double>(store.total()) * (37 + 4.0 * static_cast<double>(attributes)));
  constexpr double kProgram = 40e6;
  // What the model leaves out goes with the window, too: counting cells, clustering, bins, and the allocator's gaps.
  constexpr double kRest = 2.1;
  return static_cast<std::uint64_t>(kProgram + cached + kRest * window);
}

}  // namespace

void check_settings(const SurfaceSettings& s) {
  require(s.blend > 0 && s.blend <= 64, "--blend", "in (0, 64]");
  require(s.steps >= 1 && s.steps <= 16, "--steps", "in 1..16");
  require(s.levels >= 0 && s.levels <= kMaxLevels, "--levels", "in 1..12, or 0 to choose by the radii");
  require(s.density >= 2 && s.density <= 4096, "--density", "in 2..4096");
  require(s.radius_scale > 0 && s.radius_scale <= 1000, "--particlescale", "in (0, 1000]");
  require(s.cell.value > 0, "--cell", "positive");
  require(s.boundary >= 0, "--boundary", "0 (no limit) or positive, in influence radii");
  require(s.chord >= 0 && s.chord <= 1, "--chord", "in 0..1");
  require(s.window >= 1 && s.window <= 1024, "--window", "in 1..1024");
  check_volume_export(s.volume);
  require(!s.input.empty(), "the input", "a point file");
  require(s.dry_run || !s.output.empty(), "--output", "given");
}

Resolved resolve_plan(const SurfaceSettings& s, const Frame& frame, const SlabStore& store, const Extent& bounds,
                      bool given_radii, std::size_t attributes) {
  RadiusSurvey survey = survey_radii(store, kSurveySamples, s.density);
  if (!given_radii) {
    for (float* r : {&survey.low, &survey.median, &survey.high}) *r *= static_cast<float>(s.radius_scale);
  }
  if (!(survey.median > 0)) {
    throw Error(ExitCode::empty,
                fmt::format("{}: no sampling density can be estimated: the samples lie at too few places", s.input));
  }
  const double max_radius = resolve(s.max_radius, survey.median * frame.step, s.blend) / frame.step;
  if (max_radius > 0) {
    for (float* r : {&survey.low, &survey.median, &survey.high}) *r = std::min(*r, static_cast<float>(max_radius));
  }

  Resolved out;
  Levels levels{};
  out.feed.blend = static_cast<float>(s.blend);
  out.feed.radius_scale = static_cast<float>(s.radius_scale);
  out.feed.max_radius = static_cast<float>(max_radius);
  if (s.cell.unit == Length::Unit::world) {
    // A fixed cell: one level in use, whatever the radii.
    levels = {s.cell.value / frame.step, s.levels > 0 ? s.levels : kDefaultLevels};
    out.feed.fixed_cell = true;
    out.feed.cell_ratio = 1;
  } else {
    out.feed.cell_follows_support = s.cell.unit == Length::Unit::influence_radius;
    out.feed.cell_ratio = s.cell.value;
    levels = choose_levels(s, s.cell.value * (out.feed.cell_follows_support ? s.blend : 1.0), survey);
  }
  double reach = 0;
  for (const std::int32_t end : {bounds.x_min, bounds.x_max, bounds.y_min, bounds.y_max, bounds.z_min, bounds.z_max}) {
    reach = std::max(reach, std::abs(static_cast<double>(end)));
  }
  const double smallest = std::max(static_cast<double>(kMinSteps), reach / kMaxCells);
  if (levels.finest < smallest) {
    if (s.cell.unit == Length::Unit::world) {
      usage(fmt::format("--cell {}: too small for a cloud of this extent; the least is {:.3g}", s.cell.value,
                        smallest * frame.step));
    }
    // Detail finer than the lattice can address: the finest level ends there.
    const int skip = static_cast<int>(std::ceil(std::log2(smallest / levels.finest)));
    levels.finest = std::ldexp(levels.finest, skip);
    levels.count = std::max(s.levels > 0 ? s.levels : kDefaultLevels, levels.count - skip);
  }
  // A lattice much coarser than the cloud adds nothing and would overflow the fixed-point range.
  constexpr double kMaxSlab = 1 << 28;
  if (levels.finest > kMaxSlab && s.cell.unit == Length::Unit::world) {
    usage(fmt::format("--cell {}: larger than the whole cloud", s.cell.value));
  }
  levels.finest = std::min(levels.finest, kMaxSlab);
  while (std::ldexp(levels.finest, levels.count - 1) > kMaxSlab) --levels.count;

  out.lattice.cell = static_cast<std::int32_t>(std::lrint(levels.finest));
  out.lattice.levels = levels.count;
  if (!out.feed.fixed_cell) {
    const double ratio = s.cell.value * (out.feed.cell_follows_support ? s.blend : 1.0);
    const double above_finest = std::log2(kMainCell * ratio * survey.median / out.lattice.cell);
    out.main_level = static_cast<int>(std::clamp(std::lround(above_finest), 0L, static_cast<long>(levels.count) - 1));
  }
  out.radii.min_samples = s.density;
  set_counting_cells(s, survey, out);

  SurfacePlan& plan = out.plan;
  plan.samples = store.total();
  const auto length = [&](std::int32_t low, std::int32_t high) {
    return static_cast<double>(std::int64_t{high} - low) * frame.step;
  };
  plan.extent = {length(bounds.x_min, bounds.x_max), length(bounds.y_min, bounds.y_max),
                 length(bounds.z_min, bounds.z_max)};
  plan.radius_low = survey.low * frame.step;
  plan.radius_median = survey.median * frame.step;
  plan.radius_high = survey.high * frame.step;
  plan.finest_cell = out.lattice.cell * frame.step;
  plan.levels = out.lattice.levels;
  plan.slab_height = out.lattice.slab_height() * frame.step;
  plan.slabs = out.lattice.slab_of(bounds.z_max) - out.lattice.slab_of(bounds.z_min) + 1;
  plan.buckets = store.buckets();
  plan.memory_bytes = expected_memory(s, out, store, attributes);
  plan.disk_bytes = store.disk_bytes() + expected_face_bytes(s, out, survey, store.total());
  return out;
}

std::string describe(const SurfacePlan& p, const SurfaceSettings& s) {
  const auto mb = [](std::uint64_t bytes) { return static_cast<double>(bytes) / 1e6; };
  std::string out;
  out += fmt::format("samples {}, extent {:.4g} x {:.4g} x {:.4g}\n", p.samples, p.extent[0], p.extent[1], p.extent[2]);
  out += fmt::format("radius r {:.4g} (1 % {:.4g}, 99 % {:.4g}), influence R = {:g} r\n", p.radius_median, p.radius_low,
                     p.radius_high, s.blend);
  out += fmt::format("levels {}, cells {:.4g} to {:.4g}, slabs {} of {:.4g}\n", p.levels, p.finest_cell,
                     std::ldexp(p.finest_cell, p.levels - 1), p.slabs, p.slab_height);
  out += fmt::format("expected memory {:.0f} MB, temporary disk {:.0f} MB", mb(p.memory_bytes), mb(p.disk_bytes));
  return out;
}

}  // namespace lamina

#include "reconstruct/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "lamina/error.h"
#include "levelset/surface_volume.h"
#include "meshes/formats.h"
#include "meshes/mesh_sink.h"
#include "reconstruct/constants.h"
#include "simplify/streamed.h"

namespace lamina {
namespace {

constexpr int kDefaultLevels = 4;
/// Slabs are as high as the coarsest cells. Levels that no radius asks for make none higher than so many median radii:
/// twice as high would take a third more memory for next to no time. Where density varies, coarse levels serve the few
/// samples that are sparser than the survey's 99 %.
constexpr double kSlabRadii = 4.5;
/// Nor do such levels make slabs that hold more samples on average: with as many, slabs half as high take a quarter
/// less memory and a fiftieth more time; with half as many, a twentieth.
constexpr double kSlabSamples = 40000;
constexpr int kMaxLevels = 12;
constexpr std::int32_t kMinSteps = 64;  ///< fixed-point steps a finest cell must have for exact enough positions
constexpr double kMaxCells = 1 << 20;   ///< finest cells from the origin, the limit of the lattice's keys
constexpr double kMaxSlab = 1 << 28;    ///< steps: a higher one adds nothing and would overflow the fixed-point range

[[noreturn]] void usage(const std::string& message) {
  throw Error(ExitCode::usage, message);
}

void require(bool ok, const char* option, const char* range) {
  if (!ok) usage(fmt::format("{} must be {}", option, range));
}

/// The largest leaf cell for a sample of radius 1 where cells follow the samples.
double cell_per_radius(const FeedSettings& feed) {
  return feed.cell.value * (feed.cell.unit == Length::Unit::influence_radius ? feed.blend : 1.0);
}

struct Levels {
  double finest;  ///< cell, steps
  int count;
};

/// `main`: side of the main cells in median radii; `finer`: levels below them.
int levels_in_slab(double main, int finer) {
  return std::clamp(1 + finer + static_cast<int>(std::floor(std::log2(kSlabRadii / main))), 1, kDefaultLevels);
}

/// The levels that leave slabs few enough samples; `asked_for` by the radii. `in_cell`: samples in a layer of finest
/// cells, on average.
int without_spare_levels(int levels, int asked_for, double in_cell) {
  while (levels > asked_for && std::ldexp(in_cell, levels - 1) > kSlabSamples) --levels;
  return levels;
}

/// Samples in a layer of the cloud one step high, on average.
double samples_in_step(const ReconstructionPlan& plan) {
  return static_cast<double>(plan.samples) / (1.0 + plan.extent.z_max - plan.extent.z_min);
}

/// Main cells follow the median radius; levels are added below for the 1 % smallest and for sheets, and above for the
/// 1 % largest.
Levels choose_levels(int asked, const ReconstructionPlan& plan) {
  const FeedSettings& feed = plan.feed;
  const RadiusSurvey& radii = plan.radius;
  const double ratio = cell_per_radius(feed);
  const double main = kMainCell * ratio * radii.median;
  const int finer = std::max(0, static_cast<int>(std::ceil(std::log2(main / (ratio * radii.low)) - 1e-9))) +
                    (feed.refine_sheets ? 1 : 0);
  const int coarser = std::max(0, static_cast<int>(std::floor(std::log2(ratio * radii.high / main))));
  const int by_radii = finer + coarser + 1;
  const bool even = radii.high < kEven * radii.low;
  const int least = even ? without_spare_levels(levels_in_slab(kMainCell * ratio, finer), by_radii,
                                                std::ldexp(main, -finer) * samples_in_step(plan))
                         : kDefaultLevels;
  const int count = asked > 0 ? asked : std::clamp(by_radii, least, kMaxLevels);
  return {std::ldexp(main, -std::min(finer, count - 1)), count};
}

/// What of them the lattice can address in a cloud of this extent. Throws Error(usage) for a cell asked for that it
/// cannot.
Levels addressable(Levels levels, int asked, const FeedSettings& feed, const Extent& bounds, double step) {
  double farthest = 0;
  for (const std::int32_t end : {bounds.x_min, bounds.x_max, bounds.y_min, bounds.y_max, bounds.z_min, bounds.z_max}) {
    farthest = std::max(farthest, std::abs(static_cast<double>(end)));
  }
  const double smallest = std::max(static_cast<double>(kMinSteps), farthest / kMaxCells);
  if (levels.finest < smallest) {
    if (feed.fixed_cell()) {
      usage(fmt::format("--cell {}: too small for a cloud of this extent; the least is {:.3g}", feed.cell.value,
                        smallest * step));
    }
    // Detail finer than the lattice can address: the finest level ends there.
    const int skip = static_cast<int>(std::ceil(std::log2(smallest / levels.finest)));
    levels.finest = std::ldexp(levels.finest, skip);
    levels.count = std::max(asked > 0 ? asked : std::min(levels.count, kDefaultLevels), levels.count - skip);
  }
  if (levels.finest > kMaxSlab && feed.fixed_cell())
    usage(fmt::format("--cell {}: larger than the whole cloud", feed.cell.value));
  levels.finest = std::min(levels.finest, kMaxSlab);
  while (std::ldexp(levels.finest, levels.count - 1) > kMaxSlab) --levels.count;
  return levels;
}

/// Counting cells of 16 samples are four spacings, two radii wide: so are the finest for the finest cells' radius
/// (finer ones would rarely hold as many, and take most of the time), and the coarsest serve the radius of the coarsest
/// cells.
RadiiSettings counting_cells(const SurfaceSettings& s, const ReconstructionPlan& plan) {
  RadiiSettings out;
  out.min_samples = s.density;
  double finest_radius = plan.radius.low;
  out.levels = std::max(plan.lattice.levels, kDefaultLevels);
  if (plan.feed.fixed_cell()) {
    const double octaves = std::log2(std::max(1.0F, plan.radius.high / plan.radius.low));
    out.levels = std::clamp(static_cast<int>(std::ceil(octaves)) + 3, 3, kMaxLevels);
  } else {
    const double blend = plan.feed.cell_follows_support() ? plan.feed.blend : 1.0;
    // Counting cells follow the radii, which know nothing of sheets.
    finest_radius =
        (plan.feed.refine_sheets ? 2.0 : 1.0) * plan.lattice.cell / (kMainCell * plan.feed.cell.value * blend);
  }
  const double half = kCountingHalfWidth * std::sqrt(s.density / 16.0) * finest_radius / s.radius_scale;
  out.finest_cell = static_cast<std::int32_t>(2 * std::clamp(std::lrint(half), 1L, 1L << 24));
  return out;
}

/// Radii as the samples will have them, and the largest that is not discarded (steps, 0: none).
RadiusSurvey scaled_radii(const SurfaceSettings& s, RadiusSurvey survey, const ReconstructionPlan& plan, double blend,
                          double& max_radius) {
  if (!plan.given_radii) {
    for (float* r : {&survey.low, &survey.median, &survey.high}) *r *= static_cast<float>(s.radius_scale);
  }
  if (!(survey.median > 0)) {
    throw Error(ExitCode::empty,
                fmt::format("{}: no sampling density can be estimated: the samples lie at too few places", s.input));
  }
  max_radius = resolve(s.max_radius, survey.median * plan.frame.step, blend) / plan.frame.step;
  if (max_radius > 0) {
    for (float* r : {&survey.low, &survey.median, &survey.high}) *r = std::min(*r, static_cast<float>(max_radius));
  }
  return survey;
}

/// One level in use, whatever the radii.
Levels fixed_levels(int asked, double cell, const ReconstructionPlan& plan) {
  if (asked > 0) return {cell, asked};
  return {cell, without_spare_levels(levels_in_slab(cell / plan.radius.median, 0), 1, cell * samples_in_step(plan))};
}

void plan_lattice(const SurfaceSettings& s, ReconstructionPlan& plan) {
  const bool fixed = plan.feed.fixed_cell();
  const Levels wanted =
      fixed ? fixed_levels(s.levels, plan.feed.cell.value / plan.frame.step, plan) : choose_levels(s.levels, plan);
  const Levels levels = addressable(wanted, s.levels, plan.feed, plan.extent, plan.frame.step);
  plan.lattice.cell = static_cast<std::int32_t>(std::lrint(levels.finest));
  plan.lattice.levels = levels.count;
  plan.main_level = 0;
  if (!fixed) {
    const double above_finest =
        std::log2(kMainCell * cell_per_radius(plan.feed) * plan.radius.median / plan.lattice.cell);
    plan.main_level = static_cast<int>(std::clamp(std::lround(above_finest), 0L, static_cast<long>(levels.count) - 1));
  }
  if (!s.volume.path.empty() && !s.volume.levels)
    volume_level(s.volume, plan.frame.step, plan.lattice, plan.main_level);
  plan.slabs = all_slabs(plan.lattice, plan.extent);
  plan.refit.max_radius = 1.5F * plan.radius.high;
  plan.refit.level = plan.main_level;
  plan.radii = counting_cells(s, plan);
}

/// Float positions keep a hundredth of a cell as long as the coordinates are below some ten thousand cells;
/// georeferenced ones are not. Nor can float hold the very large and the very small.
bool needs_double(const Census& census, double finest_cell) {
  constexpr double kLargest = 1e37;
  constexpr double kSmallestCell = 1e-35;
  const double largest = std::max(census.low.cwiseAbs().maxCoeff(), census.high.cwiseAbs().maxCoeff());
  return largest * 0x1p-24 > 0.01 * finest_cell || largest > kLargest || finest_cell < kSmallestCell;
}

void refuse_two_alike(const SurfaceSettings& settings, const ReconstructionPlan& plan) {
  for (const AttributeSpec& a : plan.attributes) {
    if ((settings.vertex_levels && a.name == "level") || (settings.vertex_curvature && a.name == "curvature") ||
        (settings.vertex_filled && a.name == "filled") || (settings.fill_all && a.name == "invented")) {
      throw Error(ExitCode::usage,
                  fmt::format("{}: the points have an attribute called {} already; leave out {}", plan.input, a.name,
                              a.name == "invented" ? "--fill all" : "--" + a.name));
    }
  }
}

void plan_mesh(const SurfaceSettings& s, const StoredCloud& cloud, ReconstructionPlan& plan) {
  refuse_two_alike(s, plan);
  const double median = plan.radius.median * plan.frame.step;
  const double influence = plan.feed.blend * median;
  plan.cluster = s.cluster;
  plan.chord = static_cast<float>(s.chord);
  plan.vertex_levels = s.vertex_levels;
  plan.vertex_curvature = s.vertex_curvature;
  // Cells follow the radii, so most cells tell the median radius and larger ones as much more. Cells that are smaller
  // between sheets tell nothing.
  plan.vertex_radii = {influence / static_cast<double>(plan.lattice.cell_size(plan.main_level)),
                       plan.feed.refine_sheets ? influence : 0};
  const std::uint64_t specks = s.prune_triangles ? 0 : std::min(kSpeckSamples, plan.samples / kSpeckShare);
  plan.pruning = {s.prune_triangles.value_or(kSpeckTriangles), specks, resolve(s.prune_size, median, plan.feed.blend)};
  plan.projection.leans = plan.trim > 0;
  plan.projection.densities = specks > 0;
  plan.mesh_attributes = plan.attributes;
  if (s.vertex_levels) plan.mesh_attributes.push_back({"level", ScalarType::uint8});
  if (s.vertex_curvature) plan.mesh_attributes.push_back({"curvature", ScalarType::float32});
  if (s.vertex_filled) plan.mesh_attributes.push_back({"filled", ScalarType::uint8});
  if (s.fill_all) plan.mesh_attributes.push_back({"invented", ScalarType::uint8});
  plan.double_positions = needs_double(cloud.ingested.census, plan.lattice.cell * plan.frame.step);
  const std::vector<std::string> outputs = output_names(s);
  if (std::none_of(outputs.begin(), outputs.end(),
                   [](const std::string& name) { return meshes::mesh_format(name) == meshes::MeshFormat::ply; }))
    plan.waiting_vertex_bytes = vertex_record_bytes(plan.mesh_attributes, plan.double_positions);
  plan.volume = s.volume;
  plan.volume.shift = cloud.shift;
  plan.volume.crs = cloud.info.crs;
  plan.simplify = s.simplify;
  if (!s.simplify.wanted()) plan.simplify.deviation = s.deviation ? *s.deviation : choose_deviation(plan.radius);
  plan.tiles = s.tiles;
  plan.tiles.crs = cloud.shift ? std::string() : cloud.info.crs;  // shifted coordinates are not those of the system
  if (!cloud.info.crs.empty()) plan.comments.push_back("crs " + cloud.info.crs);
  if (cloud.shift) plan.comments.push_back("shift " + shift_text(*cloud.shift));
}

}  // namespace

void check_settings(const SurfaceSettings& s) {
  require(!s.blend || (*s.blend > 0 && *s.blend <= 64), "--blend", "auto or in (0, 64]");
  require(!s.refit || (*s.refit >= 0 && *s.refit <= 8), "--refit", "auto or in 0..8");
  require(s.steps >= 0 && s.steps <= 16, "--steps", "in 1..16, or auto");
  require(s.step_tolerance > 0 && s.step_tolerance <= 1, "--step-tolerance", "in (0, 1], in radii");
  require(!s.vertex_curvature || s.fit == FitMode::sphere, "--curvature",
          "left out with --fit plane, which knows none");
  require(s.levels >= 0 && s.levels <= kMaxLevels, "--levels", "in 1..12, or 0 to choose by the radii");
  require(s.density >= 2 && s.density <= 4096, "--density", "in 2..4096");
  require(s.radius_scale > 0 && s.radius_scale <= 1000, "--particlescale", "in (0, 1000]");
  require(!s.cell || s.cell->value > 0, "--cell", "positive");
  require(s.boundary >= 0, "--boundary", "0 (no limit) or positive, in influence radii");
  require(s.close_holes.value_or(0) >= 0, "--close-holes", "0 (none) or positive, in influence radii");
  require(!s.watertight.value_or(false) || (s.close_holes.value_or(1) > 0 && s.cluster != ClusterMode::free),
          "--watertight", "left out with --close-holes 0 and with --cluster free, which close no holes");
  require(!s.bridge.value_or(false) || (s.close_holes.value_or(1) > 0 && s.cluster != ClusterMode::free), "--bridge",
          "left out with --close-holes 0 and with --cluster free, which close no holes");
  require(!s.fill_all || s.cluster != ClusterMode::free, "--fill all",
          "left out with --cluster free, which lets boundary loops meet");
  require(!s.trim || (*s.trim >= 0 && *s.trim < 1), "--trim", "auto or in [0, 1), in influence radii");
  require(s.chord >= 0 && s.chord <= 1, "--chord", "in 0..1");
  require(s.window >= 1 && s.window <= 1024, "--window", "in 1..1024");
  require_sane(s.clean);
  if (s.simplify.wanted()) simplify::require_goal(s.simplify);
  require(s.deviation.value_or(0) >= 0 && s.deviation.value_or(0) <= 1, "--deviation", "auto or in 0..1, in edges");
  check_volume_export(s.volume);
  require(!s.input.empty(), "the input", "a point file");
  require(!s.receiver || s.tiles.folder.empty(), "--tiles", "left out where the mesh goes to no file");
  require(s.dry_run || s.receiver || !s.output.empty(), "--output", "given");
}

CloudSurvey survey_cloud(const SurfaceSettings& s, const SlabStore& store, const ReadBucket& read) {
  CloudSurvey out;
  out.radii = survey_radii(store, read, kSurveySamples, s.density);
  out.noisy = is_noisy(out.radii, out.support);
  if (s.blend) return out;
  if (out.radii.noise > kPerhapsNoisy) {
    out.support = survey_support(store, read, out.radii, SupportAim::noise);
    out.noisy = is_noisy(out.radii, out.support);
    if (out.noisy) return out;
    out.support = {};
  }
  if (out.radii.lopsided > kLopsided) out.support = survey_support(store, read, out.radii, SupportAim::all_round);
  return out;
}

ReconstructionPlan make_plan(const SurfaceSettings& s, const StoredCloud& cloud, const CloudSurvey& survey) {
  const SlabStore& store = cloud.ingested.store;
  ReconstructionPlan plan;
  plan.input = input_name(s);
  plan.samples = store.total();
  plan.buckets = store.buckets();
  plan.frame = cloud.frame;
  plan.extent = cloud.ingested.extent;
  plan.attributes = cloud.info.attributes;
  plan.given_radii = cloud.info.has_radius;
  plan.window = s.window;
  plan.boundary = static_cast<float>(s.boundary);

  choose_support(s, survey, cloud.info, plan);
  // Normals that were found from the positions tell nothing that a fit over more of them does not.
  plan.refit.noise = cloud.info.found_normals ? static_cast<float>(std::numbers::pi) : survey.radii.normal_noise;
  double max_radius = 0;
  plan.radius = scaled_radii(s, survey.radii, plan, plan.feed.blend, max_radius);
  plan.feed.max_radius = static_cast<float>(max_radius);
  plan_lattice(s, plan);
  plan_mesh(s, cloud, plan);
  plan.expected = expected_cost(plan, cloud.ingested);
  return plan;
}

MeshSinkSettings mesh_layout(const ReconstructionPlan& plan) {
  MeshSinkSettings out;
  out.attributes = plan.mesh_attributes;
  out.double_positions = plan.double_positions;
  out.comments = plan.comments;
  return out;
}

double sample_reach(const ReconstructionPlan& plan) {
  return static_cast<double>(support_limit(plan.feed, plan.lattice)) +
         static_cast<double>(Projector(plan.projection, select_kernel()).margin(plan.lattice));
}

std::int64_t samples_end(const Lattice& lattice, std::int64_t end, double reach) {
  const std::int64_t height = lattice.slab_height();
  return std::max((end + kTouchSlabs) * height, end * height + static_cast<std::int64_t>(reach) + 1);
}

ZRead z_read(const ReconstructionPlan& plan, const SlabSpan& span) {
  const std::int64_t height = plan.lattice.slab_height();
  const StageSpans stages = plan.stages_of(span);
  const SlabSpan& projected = stages.of(Stage::project);
  const double ahead = sample_reach(plan);
  ZRead z;
  if (span.begin > plan.slabs.begin) {
    z.from = std::min(stages.of(Stage::mark).begin * height,
                      projected.begin * height - static_cast<std::int64_t>(std::ceil(ahead)) - 1);
  }
  z.to = samples_end(plan.lattice, projected.end, ahead);
  return z;
}

SurfacePlan summary_of(const ReconstructionPlan& p) {
  SurfacePlan out;
  const double step = p.frame.step;
  const auto length = [&](std::int32_t low, std::int32_t high) {
    return static_cast<double>(std::int64_t{high} - low) * step;
  };
  out.samples = p.samples;
  out.extent = {length(p.extent.x_min, p.extent.x_max), length(p.extent.y_min, p.extent.y_max),
                length(p.extent.z_min, p.extent.z_max)};
  out.radius_low = p.radius.low * step;
  out.radius_median = p.radius.median * step;
  out.radius_high = p.radius.high * step;
  out.noise = static_cast<double>(p.radius.noise);
  out.high_noise = static_cast<double>(p.radius.high_noise);
  out.worst_noise = static_cast<double>(p.radius.worst_noise);
  const auto& [x, y, z] = p.radius.noisiest;
  Eigen::Map<Eigen::Vector3d>(out.noisiest.data()) = p.frame.to_world(Eigen::Vector3f(x, y, z).cast<double>());
  out.normal_noise = static_cast<double>(p.radius.normal_noise) * 180 / std::numbers::pi;
  out.blend = p.feed.blend;
  out.least_blend = p.feed.support ? static_cast<double>(p.feed.support->least()) : p.feed.blend;
  out.most_blend = p.feed.widest();
  out.refit = p.refit.only_blurred ? 0 : p.refit.support;
  out.lines = p.lines;
  out.blurred_normals = static_cast<double>(p.radius.blurred);
  out.features = p.projection.creases;
  out.sharpen = p.refit.only_blurred;
  out.cell = p.feed.cell;
  out.refine_sheets = p.feed.refine_sheets;
  out.watertight = p.holes.watertight != Watertight::no;
  out.bridge = p.holes.bridge;
  out.trim = p.trim;
  out.deviation = p.simplify.deviation;
  out.longest_rim = p.holes.longest;
  out.finest_cell = p.lattice.cell * step;
  out.levels = p.lattice.levels;
  out.slab_height = p.lattice.slab_height() * step;
  out.slabs = p.lattice.slab_of(p.extent.z_max) - p.lattice.slab_of(p.extent.z_min) + 1;
  out.buckets = p.buckets;
  out.memory_bytes = p.expected.memory;
  out.disk_bytes = p.expected.disk;
  return out;
}

}  // namespace lamina

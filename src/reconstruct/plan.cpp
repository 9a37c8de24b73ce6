#include "reconstruct/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "lamina/error.h"
#include "levelset/surface_volume.h"
#include "reconstruct/choose_support.h"

namespace lamina {
namespace {

/// The size of most cells in units of the largest the median radius allows: with 0.64 the radii of an evenly sampled
/// surface (which scatter by 0.75 to 1.25 around their median) all ask for the same level.
constexpr double kMainCell = 0.7;
constexpr int kDefaultLevels = 4;
/// Expected memory from which on slabs are made half as high where the main cells are the finest.
constexpr std::uint64_t kRoomy = 224u << 20;
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

/// Main cells follow the median radius; levels are added below for the 1 % smallest and for thin things, and above for
/// the 1 % largest.
Levels choose_levels(const SurfaceSettings& s, double ratio, const RadiusSurvey& radii, bool thin_cells) {
  const double main = kMainCell * ratio * radii.median;
  const int finer =
      std::max(0, static_cast<int>(std::ceil(std::log2(main / (ratio * radii.low)) - 1e-9))) + (thin_cells ? 1 : 0);
  const int coarser = std::max(0, static_cast<int>(std::floor(std::log2(ratio * radii.high / main))));
  const int count = s.levels > 0 ? s.levels : std::clamp(finer + coarser + 1, kDefaultLevels, kMaxLevels);
  return {std::ldexp(main, -std::min(finer, count - 1)), count};
}

/// Counting cells of 16 samples are four spacings, two radii wide: so are the finest for the finest cells' radius
/// (finer ones would rarely hold as many, and take most of the time), and the coarsest serve the radius of the coarsest
/// cells.
void set_counting_cells(const SurfaceSettings& s, const RadiusSurvey& survey, Resolved& out) {
  constexpr double kHalfWidth = 1.15;
  out.radii.min_samples = s.density;
  double finest_radius = survey.low;
  out.radii.levels = out.lattice.levels;
  if (out.feed.fixed_cell) {
    const double octaves = std::log2(std::max(1.0F, survey.high / survey.low));
    out.radii.levels = std::clamp(static_cast<int>(std::ceil(octaves)) + 3, 3, kMaxLevels);
  } else {
    const double blend = out.feed.cell_follows_support ? out.support.blend : 1.0;
    // Counting cells follow the radii, which know nothing of thin things.
    finest_radius = (out.feed.thin_cells ? 2.0 : 1.0) * out.lattice.cell / (kMainCell * out.feed.cell_ratio * blend);
  }
  const double half = kHalfWidth * std::sqrt(s.density / 16.0) * finest_radius / s.radius_scale;
  out.radii.finest_cell = static_cast<std::int32_t>(2 * std::clamp(std::lrint(half), 1L, 1L << 24));
}

/// Faces wait on disk for the vertices. A sample stands for a quarter of its radius squared of surface; a main cell's
/// worth of surface gives some 3.3 triangles (the cells it cuts, two each), clustering leaves 55 % of them.
std::uint64_t expected_face_bytes(const SurfaceSettings& s, const Resolved& r, const RadiusSurvey& survey,
                                  std::uint64_t samples) {
  constexpr double kFaceBytes = 13;
  const double ratio = r.feed.cell_ratio * (r.feed.cell_follows_support ? r.support.blend : 1.0);
  const double finest = r.lattice.cell;
  const double cell = r.feed.fixed_cell ? finest : std::max(finest, kMainCell * ratio * survey.median);
  const double cells = static_cast<double>(samples) * 0.25 * survey.median * survey.median / (cell * cell);
  return static_cast<std::uint64_t>(kFaceBytes * cells * (s.cluster == ClusterMode::none ? 3.3 : 1.8));
}

/// Behind the sweep the store gives its disk back, a file at a time, while the faces grow.
std::uint64_t expected_disk(const SlabStore& store, std::uint64_t faces) {
  const std::uint64_t all = store.disk_bytes();
  return std::min(all + faces, std::max(all, faces) + all / store.files());
}

/// Of --vdb, from samples per slab and cells of surface per sample. Bricks of 8^3 voxels wait until the band around
/// them is grown, three layers of them; a brick for some 25 cells of surface. Of those written a record remains, and
/// another while the tiles' signs are found.
double expected_volume_memory(const SurfaceSettings& s, const Resolved& r, double per_slab, double cells,
                              std::uint64_t samples, std::size_t attributes) {
  if (s.volume.path.empty()) return 0;
  constexpr double kCellsPerBrick = 25, kPlanes = 24, kBrick = 10.4e3, kRecords = 60, kBuffers = 4e6;
  const double extra = attributes > 0 ? 3 * 2048.0 * static_cast<double>(s.volume.grids.size()) : 0;
  const double per_plane = per_slab * cells / r.lattice.layers(r.main_level);
  const double bricks = std::min(per_plane * kPlanes, static_cast<double>(samples) * cells) / kCellsPerBrick;
  return bricks * (kBrick + extra) + static_cast<double>(samples) * cells / kCellsPerBrick * kRecords + kBuffers;
}

/// Of fitting normals again, measured with supports of 2 to 8 r: samples within reach of the slab's whose normals are
/// found, in the order they came and in clumps; the normals until the sweep has passed; bins and rows of tiles.
double expected_refit_memory(const SurfaceSettings& s, const Resolved& r, double per_step, std::uint64_t samples) {
  if (r.refit.support <= 0) return 0;
  constexpr double kHeld = 80, kNormal = 12, kBins = 12e6;
  const double slab = r.lattice.slab_height();
  const auto within = [&](double height) { return std::min(per_step * height, static_cast<double>(samples)); };
  return kBins + kHeld * within(2 * filter_reach(r) + slab) + kNormal * within((5.0 + s.window) * slab);
}

/// Samples in the densest layer of a height, from the store's own counts: each bucket's lie evenly between its ends.
double densest_layer(const SlabStore& store, std::int32_t height) {
  double most = 0;
  std::size_t first = 0;
  for (std::size_t last = 0; last < store.buckets(); ++last) {
    if (store.count(last) == 0) continue;
    // A densest layer ends with a bucket, or begins with one; this one ends with `last`.
    const double end = static_cast<double>(store.z_upper(last)) + 1, begin = end - height;
    while (first < last && (store.count(first) == 0 || static_cast<double>(store.z_upper(first)) < begin)) ++first;
    double sum = 0;
    for (std::size_t b = first; b <= last; ++b) {
      if (store.count(b) == 0) continue;
      const auto low = static_cast<double>(store.z_lower(b)), high = static_cast<double>(store.z_upper(b)) + 1;
      sum += static_cast<double>(store.count(b)) * (high - std::max(low, begin)) / (high - low);
    }
    most = std::max(most, sum);
  }
  return most;
}

std::uint64_t expected_memory(const SurfaceSettings& s, const Resolved& r, const SlabStore& store,
                              std::size_t attributes) {
  const double per_slab = densest_layer(store, r.lattice.slab_height());
  // A sample stands for a quarter of its radius squared of surface; around each cell of surface lie some four and a
  // half corners, and one and a half cells cross it. Coefficients: docs/performance.md.
  const double main_cell = kMainCell * r.feed.cell_ratio * (r.feed.cell_follows_support ? r.support.blend : 1.0);
  const double cells = r.feed.fixed_cell ? 1.0 : 0.25 / (main_cell * main_cell);
  const double corner_bytes =
      4.5 * cells * (4.0 * (static_cast<double>(kFirstAttribute) + static_cast<double>(attributes)) + 12);
  const double surface_bytes = 1.5 * cells * (56 + 4.0 * static_cast<double>(attributes) + 2 * 12 + 1.5 * 16);
  const double window = per_slab * ((3.0 + s.window) * corner_bytes + (5.0 + s.window) * surface_bytes);
  const double cached = std::min(static_cast<double>(r.feed.cache_bytes),
                                 static_cast<double>(store.total()) * (37 + 4.0 * static_cast<double>(attributes)));
  constexpr double kProgram = 60e6;
  // What the window's count leaves out - counting cells, clustering, bins, and the allocator's gaps - grows with it,
  // and faster: fitted to runs of 1 M to 380 M samples.
  constexpr double kPart = 0.158, kGrowth = 1.58;
  const double rest = 1e6 * kPart * std::pow(1e-6 * window, kGrowth);
  const double volume = expected_volume_memory(s, r, per_slab, cells, store.total(), attributes);
  return static_cast<std::uint64_t>(kProgram + cached + rest + volume +
                                    expected_refit_memory(s, r, per_slab / r.lattice.slab_height(), store.total()));
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
  require(s.close_holes >= 0, "--close-holes", "0 (none) or positive, in influence radii");
  require(!s.watertight.value_or(false) || hole_settings(s, {}).longest > 0, "--watertight",
          "left out with --close-holes 0 and with --cluster free, which close no holes");
  require(s.chord >= 0 && s.chord <= 1, "--chord", "in 0..1");
  require(s.window >= 1 && s.window <= 1024, "--window", "in 1..1024");
  require_sane(s.clean);
  check_volume_export(s.volume);
  require(!s.input.empty(), "the input", "a point file");
  require(s.dry_run || !s.output.empty(), "--output", "given");
}

namespace {

Resolved plan_once(const SurfaceSettings& s, const Frame& frame, const SlabStore& store, const Extent& bounds,
                   RadiusSurvey survey, const SupportChoice& support, bool given_radii, std::size_t attributes) {
  const Length cell = support.cell;
  if (!given_radii) {
    for (float* r : {&survey.low, &survey.median, &survey.high}) *r *= static_cast<float>(s.radius_scale);
  }
  if (!(survey.median > 0)) {
    throw Error(ExitCode::empty,
                fmt::format("{}: no sampling density can be estimated: the samples lie at too few places", s.input));
  }
  const double max_radius = resolve(s.max_radius, survey.median * frame.step, support.blend) / frame.step;
  if (max_radius > 0) {
    for (float* r : {&survey.low, &survey.median, &survey.high}) *r = std::min(*r, static_cast<float>(max_radius));
  }

  Resolved out;
  Levels levels{};
  out.support = support;
  out.feed.blend = static_cast<float>(support.blend);
  out.feed.radius_scale = static_cast<float>(s.radius_scale);
  out.feed.max_radius = static_cast<float>(max_radius);
  out.feed.thin_cells = support.thin_cells;
  if (cell.unit == Length::Unit::world) {
    // A fixed cell: one level in use, whatever the radii.
    levels = {cell.value / frame.step, s.levels > 0 ? s.levels : kDefaultLevels};
    out.feed.fixed_cell = true;
    out.feed.cell_ratio = 1;
  } else {
    out.feed.cell_follows_support = cell.unit == Length::Unit::influence_radius;
    out.feed.cell_ratio = cell.value;
    levels = choose_levels(s, cell.value * (out.feed.cell_follows_support ? support.blend : 1.0), survey,
                           support.thin_cells);
  }
  double reach = 0;
  for (const std::int32_t end : {bounds.x_min, bounds.x_max, bounds.y_min, bounds.y_max, bounds.z_min, bounds.z_max}) {
    reach = std::max(reach, std::abs(static_cast<double>(end)));
  }
  const double smallest = std::max(static_cast<double>(kMinSteps), reach / kMaxCells);
  if (levels.finest < smallest) {
    if (cell.unit == Length::Unit::world) {
      usage(fmt::format("--cell {}: too small for a cloud of this extent; the least is {:.3g}", cell.value,
                        smallest * frame.step));
    }
    // Detail finer than the lattice can address: the finest level ends there.
    const int skip = static_cast<int>(std::ceil(std::log2(smallest / levels.finest)));
    levels.finest = std::ldexp(levels.finest, skip);
    levels.count = std::max(s.levels > 0 ? s.levels : kDefaultLevels, levels.count - skip);
  }
  // A lattice much coarser than the cloud adds nothing and would overflow the fixed-point range.
  constexpr double kMaxSlab = 1 << 28;
  if (levels.finest > kMaxSlab && cell.unit == Length::Unit::world) {
    usage(fmt::format("--cell {}: larger than the whole cloud", cell.value));
  }
  levels.finest = std::min(levels.finest, kMaxSlab);
  while (std::ldexp(levels.finest, levels.count - 1) > kMaxSlab) --levels.count;

  out.lattice.cell = static_cast<std::int32_t>(std::lrint(levels.finest));
  out.lattice.levels = levels.count;
  if (!out.feed.fixed_cell) {
    const double ratio = cell.value * (out.feed.cell_follows_support ? support.blend : 1.0);
    const double above_finest = std::log2(kMainCell * ratio * survey.median / out.lattice.cell);
    out.main_level = static_cast<int>(std::clamp(std::lround(above_finest), 0L, static_cast<long>(levels.count) - 1));
  }
  if (!s.volume.path.empty() && !s.volume.levels) volume_level(s.volume, frame.step, out.lattice, out.main_level);
  out.refit = {static_cast<float>(support.refit), 1.5F * survey.high, out.main_level};
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
  plan.noise = static_cast<double>(survey.noise);
  plan.blend = support.blend;
  plan.refit = support.refit;
  plan.cell = cell;
  plan.thin_cells = support.thin_cells;
  plan.watertight = hole_settings(s, support).watertight;
  plan.finest_cell = out.lattice.cell * frame.step;
  plan.levels = out.lattice.levels;
  plan.slab_height = out.lattice.slab_height() * frame.step;
  plan.slabs = out.lattice.slab_of(bounds.z_max) - out.lattice.slab_of(bounds.z_min) + 1;
  plan.buckets = store.buckets();
  plan.memory_bytes = expected_memory(s, out, store, attributes);
  plan.disk_bytes = expected_disk(store, expected_face_bytes(s, out, survey, store.total()));
  return out;
}

}  // namespace

Resolved resolve_plan(const SurfaceSettings& s, const Frame& frame, const SlabStore& store, const Extent& bounds,
                      bool given_radii, std::size_t attributes) {
  return resolve_plan(s, frame, store, bounds, survey_radii(store, kSurveySamples, s.density), given_radii, attributes);
}

Resolved resolve_plan(const SurfaceSettings& s, const Frame& frame, const SlabStore& store, const Extent& bounds,
                      const RadiusSurvey& radii, bool given_radii, std::size_t attributes) {
  const SupportChoice support = choose_support(s, radii);
  Resolved out = plan_once(s, frame, store, bounds, radii, support, given_radii, attributes);
  // Where most cells are of the finest level, the coarsest of the default levels only makes slabs higher: faster on
  // small clouds, but twice the memory.
  SurfaceSettings bare = s;  // the mesh must not depend on whether there is a volume beside it
  bare.volume.path.clear();
  if (s.levels == 0 && out.lattice.levels == kDefaultLevels && out.main_level == 0 &&
      expected_memory(bare, out, store, attributes) > kRoomy) {
    SurfaceSettings lower = s;
    lower.levels = kDefaultLevels - 1;
    return plan_once(lower, frame, store, bounds, radii, support, given_radii, attributes);
  }
  return out;
}

double filter_reach(const Resolved& r) {
  return r.refit.support > 0 ? RefitNormals(r.refit, r.lattice, select_kernel()).reach() : 0;
}

double expected_cpu_seconds(const SurfaceSettings& s, const Resolved& r, std::size_t attributes) {
  // Seconds a sample: read and stored, counted, marked, gathered for its tiles; its share of the sums, by projection
  // steps; and per cell of surface, which a sample gives some: refined, numbered, triangulated, clustered, written.
  // Coefficients: docs/performance.md.
  constexpr double kSample = 230e-9;
  constexpr double kPerAttribute = 45e-9;
  constexpr double kSums = 300e-9;
  constexpr double kCell = 1190e-9;
  constexpr double kRefit = 550e-9, kRefitSums = 30e-9;  // --refit: each sample, and by the square of the support
  constexpr double kVoxels = 150e-9;                     // --vdb: for each voxel of the band's half width and two more
  constexpr double kStep = 0.75;                         // a further projection step against the first
  constexpr double kSupport = 1 / 0.63;                  // influence radius of a main cell, cells
  const double influence = r.support.blend * r.plan.radius_median;
  const double main_cell =
      r.feed.fixed_cell ? r.plan.finest_cell
                        : std::max(r.plan.finest_cell, kMainCell * r.feed.cell_ratio *
                                                           (r.feed.cell_follows_support ? r.support.blend : 1.0) *
                                                           r.plan.radius_median);
  const double reach = std::max(1.0, influence / main_cell / kSupport);
  const double cells = 0.25 * r.plan.radius_median * r.plan.radius_median / (main_cell * main_cell);
  constexpr double kUsualSteps = 1.2;  // more than the first, where corners say how many
  const double sums =
      kSums * reach * reach * (1 + kStep * (s.steps == 0 ? kUsualSteps : s.steps - 1)) * (s.diffuse ? 2 : 1);
  const double volume = s.volume.path.empty() ? 0 : kVoxels * (2 + s.volume.band);
  const auto support = static_cast<double>(r.refit.support);
  const double refit = support > 0 ? kRefit + kRefitSums * support * support : 0;
  const double per_sample =
      kSample + kPerAttribute * static_cast<double>(attributes) + refit + sums + (kCell + volume) * cells;
  return static_cast<double>(r.plan.samples) * per_sample;
}

namespace {

/// No more exact than the model: seconds below a minute and a half, then minutes, then hours.
std::string about(double seconds) {
  if (seconds < 10) return fmt::format("{:.1f} s", seconds);
  if (seconds < 90) return fmt::format("{:.0f} s", seconds);
  if (seconds < 5400) return fmt::format("{:.0f} min", seconds / 60);
  return fmt::format("{:.1f} h", seconds / 3600);
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

}  // namespace lamina

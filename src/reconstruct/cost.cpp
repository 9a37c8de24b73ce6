#include "reconstruct/plan.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>

#include "meshes/mesh_sink.h"
#include "octree/layer_table.h"
#include "reconstruct/constants.h"
#include "reconstruct/stages.h"
#include "simplify/streamed.h"

namespace lamina {
namespace {

/// Of reading the input, a sample.
constexpr double kReferenceRead = 80e-9;

/// Side of most cells in radii, where cells follow them.
double main_cell(const FeedSettings& feed) {
  return kMainCell * feed.cell_ratio() * (feed.cell_follows_support() ? feed.blend : 1.0);
}

/// Cells of surface that a sample stands for.
double cells_per_sample(const FeedSettings& feed) {
  if (feed.fixed_cell()) return 1.0;
  return kSampleArea / (main_cell(feed) * main_cell(feed));
}

/// Faces wait on disk for the vertices, and both for a format that is not PLY.
std::uint64_t expected_waiting_bytes(const ReconstructionPlan& plan) {
  constexpr double kVerticesPerFace = 0.5;
  const double face_bytes = 13 + kVerticesPerFace * static_cast<double>(plan.waiting_vertex_bytes);
  return static_cast<std::uint64_t>(face_bytes * expected_triangles(plan));
}

/// Behind the sweep the store gives its disk back, a file at a time, while the faces grow.
std::uint64_t expected_disk(const SlabStore& store, std::uint64_t faces) {
  const std::uint64_t all = store.disk_bytes();
  return std::min(all + faces, std::max(all, faces) + all / store.files());
}

/// Samples in the densest layer of a height, from the store's own counts: each bucket's lie evenly between its ends.
double densest_layer(const SlabStore& store, double height) {
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

/// Slabs whose corners have values: those projected ahead of the ones triangulated.
double slabs_with_values(const ReconstructionPlan& plan) {
  return reach_of(Stage::project).ahead + static_cast<double>(plan.window);
}

/// Slabs whose surface waits for the clusters around it: those triangulated below, and the one numbered above. (A part
/// begins a slab further below, for the positions alone.)
double slabs_with_surface(const ReconstructionPlan& plan) {
  return reach_of(Stage::triangulate).below - 1 + reach_of(Stage::number).ahead + static_cast<double>(plan.window);
}

/// Of --vdb, from samples per slab and cells of surface per sample. Bricks of 8^3 voxels wait until the band around
/// them is grown, three layers of them; a brick for some 25 cells of surface. Of those written a record remains, and
/// another while the tiles' signs are found.
double volume_memory(const ReconstructionPlan& plan, double per_slab) {
  if (plan.volume.path.empty()) return 0;
  constexpr double kCellsPerBrick = 25, kPlanes = 24, kBrick = 10.4e3, kRecords = 60, kBuffers = 4e6;
  const double cells = cells_per_sample(plan.feed);
  const double extra = plan.attributes.empty() ? 0 : 3 * 2048.0 * static_cast<double>(plan.volume.grids.size());
  const double per_plane = per_slab * cells / plan.lattice.layers(plan.main_level);
  const double all = static_cast<double>(plan.samples) * cells;
  const double bricks = std::min(per_plane * kPlanes, all) / kCellsPerBrick;
  return bricks * (kBrick + extra) + all / kCellsPerBrick * kRecords + kBuffers;
}

/// Of fitting normals again, measured with supports of 2 to 8 r: samples within reach of the slab's whose normals are
/// found, in the order they came and in clusters; the normals until the sweep has passed; bins and rows of tiles.
double refit_memory(const ReconstructionPlan& plan, double per_step) {
  if (plan.refit.support <= 0) return 0;
  constexpr double kHeld = 80, kNormal = 12, kBins = 12e6;
  const double slab = plan.lattice.slab_height();
  const double reach = RefitNormals(plan.refit, plan.lattice, select_kernel()).halo();
  const auto within = [&](double height) { return std::min(per_step * height, static_cast<double>(plan.samples)); };
  const double slabs_with_normals = reach_of(Stage::mark).ahead - 1 + static_cast<double>(plan.window);
  return kBins + kHeld * within(2 * reach + slab) + kNormal * within(slabs_with_normals * slab);
}

/// Behind the sweep: the mesh as it was waits, and regions of it, with quadrics.
void add_simplification(const ReconstructionPlan& plan, const SlabStore& store, ExpectedCost& cost) {
  constexpr double kProgram = 35e6, kRegions = 84, kPlain = 2.2e-6, kWithin = 20e-6, kFlat = 0.55e-6;
  const double triangles = expected_triangles(plan);
  const auto count = static_cast<std::uint64_t>(triangles);
  cost.memory =
      std::max(cost.memory, static_cast<std::uint64_t>(kProgram) + simplify::memory_for(plan.simplify, count));
  const double vertex = static_cast<double>(vertex_record_bytes(plan.mesh_attributes, plan.double_positions));
  const bool in_regions = plan.simplify.deviation == 0 && count > simplify::kRegionTriangles;
  const double regions = in_regions ? kRegions : 0;
  cost.disk = std::max(cost.disk, store.disk_bytes() + static_cast<std::uint64_t>(
                                                           (kFaceRecordBytes + 0.5 * vertex + regions) * triangles));
  cost.cpu_seconds += (plan.simplify.error > 0 ? kWithin : plan.simplify.deviation > 0 ? kFlat : kPlain) * triangles;
}

/// Of the samples that wait for their radii, which depend on two layers of coarsest counting cells: their order, cells
/// and radii, or all of them, no more than the cache keeps, where thin sheets are looked for or normals fitted again;
/// of those marked in slabs that are not projected yet, with what reading and sorting them takes; and of those in
/// clusters, which act on a slab.
double samples_memory(const ReconstructionPlan& plan, const SlabStore& store) {
  constexpr double kSample = 37, kWaiting = 12, kRead = 38, kAttribute = 4, kLayers = 2.5;
  const double bytes = kSample + kAttribute * static_cast<double>(plan.attributes.size());
  const double coarsest = std::ldexp(plan.radii.finest_cell, plan.radii.levels - 1);
  const bool whole = plan.given_radii || plan.feed.refines_sheets() || plan.refit.support > 0;
  const double waiting = (whole ? bytes : kWaiting) * densest_layer(store, kLayers * coarsest);
  const double reach = 2 * plan.feed.blend * static_cast<double>(plan.radius.median) + plan.lattice.slab_height();
  const double clustered = std::min(densest_layer(store, reach), static_cast<double>(plan.feed.batch_samples));
  const double slabs = reach_of(Stage::mark).ahead - reach_of(Stage::project).ahead + static_cast<double>(plan.window);
  const double marked = (bytes + kRead) * densest_layer(store, slabs * plan.lattice.slab_height());
  return std::min(static_cast<double>(plan.feed.cache_bytes), waiting) + marked + bytes * clustered;
}

double mesh_memory(const ReconstructionPlan& plan, const SlabStore& store, double per_slab) {
  // Around each cell of surface lie some four and a half corners, and one and a half cells cross it.
  const auto attributes = static_cast<double>(plan.attributes.size());
  const double cells = cells_per_sample(plan.feed);
  const auto channels = static_cast<double>(plan.projection.rare_channels() ? kFirstAttribute : kLean) + attributes;
  const double corner_bytes = 4.5 * cells * (4.0 * channels + 12);
  const double surface_bytes = 1.5 * cells * (56 + 4.0 * attributes + 2 * 12 + 1.5 * 16);
  const double per_sample = slabs_with_values(plan) * corner_bytes + slabs_with_surface(plan) * surface_bytes;
  constexpr double kProgram = 50e6;
  // What the window's count leaves out - counting cells, clustering, bins, and the allocator's gaps - grows with it,
  // and with the samples within reach, however low slabs are. Where thin sheets are looked for cells' normals come to
  // it, and more leaves.
  constexpr double kWindow = 0.77, kReach = 0.36, kReachRadii = 4.5, kSheets = 1.75;
  const double in_reach = densest_layer(store, kReachRadii * double{plan.radius.median});
  const double sheets = plan.feed.refines_sheets() ? kSheets : 1;
  const double rest = sheets * per_sample * (kWindow * per_slab + kReach * in_reach);
  return kProgram + samples_memory(plan, store) + rest + refit_memory(plan, per_slab / plan.lattice.slab_height());
}

/// Of --tiles: the cells and the leaves' buffers, and what a thread works on.
double tiles_memory(const ReconstructionPlan& plan) {
  if (plan.tiles.folder.empty()) return 0;
  constexpr double kProgram = 35e6, kLeaves = 48e6, kVertices = 64e6, kThread = 60e6;
  constexpr double kPerTriangle = 1.0, kLeafTriangles = 45'000;
  const double triangles = expected_triangles(plan);
  const double threads =
      std::min(static_cast<double>(tbb::this_task_arena::max_concurrency()), 1 + triangles / (8 * kLeafTriangles));
  return kProgram + std::min(kLeaves, 12 * triangles) + std::min(kVertices, 2 * triangles) + kThread * threads +
         kPerTriangle * triangles;
}

}  // namespace

double triangles_per_cell(ClusterMode cluster) {
  constexpr double kUnclustered = 3.3;  // the cells it cuts, two each
  constexpr double kClustered = 1.8;
  return cluster == ClusterMode::none ? kUnclustered : kClustered;
}

double expected_triangles(const ReconstructionPlan& plan) {
  const double finest = plan.lattice.cell;
  const double cell = plan.feed.fixed_cell() ? finest : std::max(finest, main_cell(plan.feed) * plan.radius.median);
  const double cells =
      static_cast<double>(plan.samples) * kSampleArea * plan.radius.median * plan.radius.median / (cell * cell);
  return cells * triangles_per_cell(plan.cluster);
}

std::uint64_t table_bytes(const ReconstructionPlan& plan, const SlabStore& store) {
  double tallest = 0;
  for (std::size_t b = 0; b < store.buckets(); ++b) {
    if (store.count(b) > 0) tallest = std::max(tallest, static_cast<double>(store.z_upper(b)) - store.z_lower(b));
  }
  constexpr double kPage = TablePage::kSide;
  double pages = 0;  // of a slab
  for (int level = 0; level < plan.lattice.levels; ++level) {
    const double block = 8.0 * plan.lattice.cell_size(level);
    const auto along = [&](std::int32_t low, std::int32_t high) {
      return std::ceil(((static_cast<double>(high) - low) / block + 3) / kPage);
    };
    const double table = along(plan.extent.x_min, plan.extent.x_max) * along(plan.extent.y_min, plan.extent.y_max);
    constexpr auto kMost = static_cast<double>(kMostTablePages);
    pages += (table <= kMost ? table : 0) * plan.lattice.layers(level) / 8;
  }
  return static_cast<std::uint64_t>(tallest / plan.lattice.slab_height() * pages * sizeof(TablePage*));
}

ExpectedCost expected_cost(const ReconstructionPlan& plan, const Ingested& cloud) {
  const SlabStore& store = cloud.store;
  const double per_slab = densest_layer(store, plan.lattice.slab_height());
  ExpectedCost out;
  out.memory = static_cast<std::uint64_t>(mesh_memory(plan, store, per_slab) + volume_memory(plan, per_slab)) +
               table_bytes(plan, store);
  out.disk = expected_disk(store, expected_waiting_bytes(plan));
  if (!plan.tiles.folder.empty()) {
    out.memory = std::max(out.memory, static_cast<std::uint64_t>(tiles_memory(plan)));
    constexpr double kSortedTriangle = 12;  // bytes, beside the mesh that waits
    const auto sorted = static_cast<std::uint64_t>(kSortedTriangle * expected_triangles(plan));
    out.disk = std::max(out.disk, expected_waiting_bytes(plan) + sorted);
  }
  out.cpu_seconds = expected_cpu_seconds(plan);
  if (plan.simplify.wanted()) add_simplification(plan, store, out);
  out.reading_seconds = kReferenceRead * static_cast<double>(plan.samples);
  return out;
}

double expected_cpu_seconds(const ReconstructionPlan& plan) {
  // Seconds a sample: read and stored, counted, marked, gathered for its tiles; its share of the sums, by projection
  // steps; and per cell of surface, which a sample gives some: refined, numbered, triangulated, clustered, written.
  constexpr double kSample = 230e-9;
  constexpr double kPerAttribute = 45e-9;
  constexpr double kSums = 300e-9;
  constexpr double kCell = 1190e-9;
  constexpr double kRefit = 550e-9, kRefitSums = 30e-9;  // --refit: each sample, and by the square of the support
  constexpr double kVoxels = 150e-9;                     // --vdb: for each voxel of the band's half width and two more
  constexpr double kStep = 0.75;                         // a further projection step against the first
  constexpr double kSupport = 1 / 0.63;                  // influence radius of a main cell, cells
  const double finest = plan.lattice.cell;
  const double cell = plan.feed.fixed_cell() ? finest : std::max(finest, main_cell(plan.feed) * plan.radius.median);
  const double wider = std::max(1.0, plan.feed.blend * plan.radius.median / cell / kSupport);
  const double cells = 0.25 * plan.radius.median * plan.radius.median / (cell * cell);
  constexpr double kUsualSteps = 1.2;  // more than the first, where corners say how many
  const bool by_corner = plan.projection.tolerance > 0;
  const double further = by_corner ? kUsualSteps : plan.projection.steps - 1;
  const double sums = kSums * wider * wider * (1 + kStep * further) * (plan.projection.centres ? 2 : 1);
  const double volume = plan.volume.path.empty() ? 0 : kVoxels * (2 + plan.volume.band);
  const double support = plan.refit.support;
  const double refit = support > 0 ? kRefit + kRefitSums * support * support : 0;
  const double attributes = kPerAttribute * static_cast<double>(plan.attributes.size());
  constexpr double kTileTriangle = 1.6e-6;  // --tiles: read, sorted, simplified, written
  const double tiles = plan.tiles.folder.empty() ? 0 : kTileTriangle * expected_triangles(plan);
  return static_cast<double>(plan.samples) * (kSample + attributes + refit + sums + (kCell + volume) * cells) + tiles;
}

// The plan in words and pictures, for a reader.
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
  std::string text = "normals of the file";
  if (stats.normals) text = stats.normals->estimated > 0 ? "normals found" : "normals of the file, turned to agree";
  text += fmt::format(", {:.2g} degrees off the surface", stats.plan.normal_noise);
  if (stats.plan.sharpen)
    text += fmt::format(", {:.2g} % interpolated over sharp edges", 100 * stats.plan.blurred_normals);
  return text;
}

std::string seen(const SurfaceStats& stats) {
  const SurfacePlan& plan = stats.plan;
  // Density radii are twice the spacing.
  std::string text = fmt::format("seen: {} samples{}, spacing {:.3g} ({:.3g} to {:.3g}){}; {}; {}", plan.samples,
                                 scans_text(stats), plan.radius_median / 2, plan.radius_low / 2, plan.radius_high / 2,
                                 plan.lines ? ", on lines" : "", noise_text(plan), normals_text(stats));
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
  const bool by_place = plan.least_blend < plan.most_blend;
  add(!s.blend, by_place ? fmt::format("--blend auto ({:.2g} to {:.2g}, by place)", plan.least_blend, plan.most_blend)
                         : fmt::format("--blend {:g}", plan.blend));
  add(!s.blend && !s.cell, fmt::format("--cell {}{}", to_string(plan.cell),
                                       plan.refine_sheets ? " (half of it where things are thin)" : ""));
  add(!s.refit && !s.blend, by_place && plan.refit > 0
                                ? fmt::format("--refit auto ({:.2g} in the middle, by place)", plan.refit)
                                : fmt::format("--refit {:g}", plan.refit));
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
  out += fmt::format("radius r {:.4g} (1 % {:.4g}, 99 % {:.4g}), influence R = {:.3g} r{}\n", p.radius_median,
                     p.radius_low, p.radius_high, p.blend, p.least_blend < p.most_blend ? " in the middle" : "");
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

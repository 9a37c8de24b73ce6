// lamina surface: oriented points in, streamed triangle mesh out.
#include "lamina/surface.h"

#include <fmt/format.h>

#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "clean_options.h"
#include "console.h"
#include "inputs.h"
#include "lamina/error.h"
#include "model.h"
#include "normal_options.h"
#include "result_file.h"
#include "surface_holes.h"
#include "surface_parts.h"
#include "surface_ranks.h"
#include "text.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct SurfaceOptions {
  std::vector<std::string> inputs;
  SurfaceSettings settings;
  RunOptions run;
  PartsOptions parts;
  std::string stats, preview;
};

void add_cleaning(nlohmann::ordered_json& j, const SurfaceStats& s, const SurfaceSettings& settings) {
  const CleanCounts& c = s.cleaned;
  j["cleaned"] = {{"clipped", c.clipped},
                  {"skipped", c.skipped},
                  {"merged", c.merged},
                  {"outliers", c.outliers},
                  {"outlier_distance", c.outlier_distance},
                  {"thinned", c.thinned}};
  if (settings.prune_triangles > 0 || settings.prune_size.value > 0) {
    j["pruned"] = {{"kept_parts", s.pruned.kept},
                   {"removed_parts", s.pruned.removed},
                   {"removed_triangles", s.pruned.removed_triangles}};
  }
  if (settings.local) j["shift"] = s.shift;
}

nlohmann::ordered_json to_json(const SurfaceStats& s, const SurfaceSettings& settings) {
  nlohmann::ordered_json j;
  j["input"] = settings.input;
  if (!settings.more_inputs.empty()) j["more_inputs"] = settings.more_inputs;
  j["output"] = settings.output;
  j["dry_run"] = settings.dry_run;
  j["samples"] = s.samples_read;
  j["samples_used"] = s.plan.samples;
  j["vertices"] = s.vertices;
  j["triangles"] = s.triangles;
  j["levels"] = s.plan.levels;
  j["leaf_cells_by_level"] = s.leaf_cells;
  j["noise"] = s.plan.noise;
  j["blend"] = s.plan.blend;
  j["refit"] = s.plan.refit;
  j["cell"] = to_string(s.plan.cell);
  j["finest_cell"] = s.plan.finest_cell;
  j["slab_height"] = s.plan.slab_height;
  j["slabs"] = s.plan.slabs;
  j["radius"] = {{"p01", s.plan.radius_low}, {"median", s.plan.radius_median}, {"p99", s.plan.radius_high}};
  j["wall_seconds"] = s.wall;
  j["cpu_seconds"] = s.cpu;
  j["peak_memory_bytes"] = s.peak_memory;
  j["expected_memory_bytes"] = s.plan.memory_bytes;
  j["temporary_disk_bytes"] = s.disk_bytes;
  j["expected_disk_bytes"] = s.plan.disk_bytes;
  j["expected_seconds"] = s.plan.seconds;
  j["stages"] = nlohmann::ordered_json::array();
  for (const StageTime& t : s.stages) j["stages"].push_back({{"stage", t.stage}, {"wall", t.wall}, {"cpu", t.cpu}});
  j["rejected"] = nlohmann::ordered_json::array();
  for (const Rejected& r : s.rejected) {
    nlohmann::ordered_json entry{{"reason", r.reason}, {"count", r.count}};
    if (r.first_row) entry["first_row"] = *r.first_row;
    j["rejected"].push_back(entry);
  }
  add_cleaning(j, s, settings);
  j["replaced_attribute_values"] = s.replaced_attributes;
  j["corners"] = {
      {"projected", s.corners}, {"seen", s.corners_seen}, {"trusted", s.corners_good}, {"sums", s.corner_sums}};
  j["contradicting_normals"] = {
      {"corners", s.corners_torn}, {"worst_slab", s.torn_slab}, {"worst_share", s.torn_share}};
  j["isosurface"] = {{"vertices", s.isovertices},
                     {"triangles", s.isotriangles},
                     {"crossing_cells", s.crossing_cells},
                     {"general_cells", s.general_cells},
                     {"rejected_loops", s.rejected_loops}};
  if (s.normals) j["normals"] = normals_json(*s.normals);
  if (settings.volume.wanted()) {
    j["volume"] = {{"files", s.volume.files},
                   {"voxelsize", s.volume.voxel},
                   {"voxels", s.volume.voxels},
                   {"points", s.volume.points},
                   {"bytes", s.volume.bytes}};
  }
  j["clusters"] = {{"seen", s.clusters.corners},
                   {"collapsed", s.clusters.collapsed},
                   {"patches", s.clusters.patches},
                   {"kept_isovertices", s.clusters.kept_isovertices},
                   {"hard", s.clusters.hard}};
  j["holes"] = holes_json(s.holes);
  return j;
}

Length length_of(const char* option, const std::string& text) {
  try {
    return parse_length(text);
  } catch (const Error& e) {
    throw CLI::ValidationError(option, e.what());
  }
}

/// A number, or `auto` where the program chooses.
CLI::Option* add_choice(CLI::App& app, const std::string& name, std::optional<double>& value, const std::string& usual,
                        const std::string& description) {
  const auto take = [&value, name](const std::string& text) {
    double number = 0;
    value.reset();
    if (text == "auto") return;
    if (!CLI::detail::lexical_cast(text, number))
      throw CLI::ValidationError(name, text + ": is neither a number nor auto");
    value = number;
  };
  return app.add_option_function<std::string>(name, take, description)->option_text("FLOAT|auto [" + usual + "]");
}

/// A picture of the mesh file: of its triangles where they can be held, of its vertices where they cannot.
void draw_preview(const SurfaceOptions& o, const std::string& mesh, const RunContext& context) {
  // Positions become doubles, and normals, projected vertices and lists of triangles come on top.
  constexpr std::uintmax_t kBytesPerByte = 4;
  constexpr std::uintmax_t kPicture = std::uintmax_t{48} << 20;
  constexpr std::uintmax_t kUnasked = std::uintmax_t{1} << 30;  // where no limit was given
  const std::uintmax_t most = context.max_memory > 0 ? context.max_memory : kUnasked;
  const bool whole = kPicture + kBytesPerByte * std::filesystem::file_size(mesh) <= most;
  Renderer renderer({}, context);
  const std::unique_ptr<Model> model = whole ? open_model(mesh, {}, context) : open_vertices(mesh, context);
  model->frame(renderer);
  model->draw(renderer);
  write_png(renderer.finish(), o.preview);
  context.info(fmt::format("{}: drew {}{}", o.preview, model->what(),
                           whole ? "" : ", the vertices: the mesh is too large to be held for a picture"));
}

void run_surface(const SurfaceOptions& o) {
  SurfaceSettings settings = o.settings;
  settings.input = pipe_name(o.inputs.front());
  for (auto name = o.inputs.begin() + 1; name != o.inputs.end(); ++name)
    settings.more_inputs.push_back(pipe_name(*name));
  settings.output = pipe_name(settings.output);
  if (o.stats == "-" && settings.output == "-") {
    throw Error(ExitCode::usage, "--stats and --output both name standard output; give one of them a file");
  }
  if (!o.preview.empty() && settings.output == "-")
    throw Error(ExitCode::usage, "--preview draws the mesh file; give --output one");
  if (!o.preview.empty() && o.parts.chunked)
    throw Error(ExitCode::usage, "--preview draws a mesh, --chunk makes only a part of one");
  if (!o.preview.empty() && o.preview == settings.output)
    throw Error(ExitCode::usage, "--preview and --output name the same file");
  if (!o.preview.empty() && !settings.dry_run && launch().rank == 0)
    ResultFile(o.preview);  // refuses what cannot be written, before the work
  RunContext context = make_context(o.run);
  // The plan is what a dry run is for: a result, not a message.
  if (settings.dry_run && o.stats != "-") {
    context.log = [say = context.log](LogLevel level, std::string_view text) {
      level == LogLevel::info ? fmt::print("{}\n", text) : say(level, text);
    };
  }
  std::optional<ResultFile> stats_file;
  if (!o.stats.empty() && launch().rank == 0) stats_file.emplace(o.stats);
  const bool ranked = launch().size > 1;
  RanksStats ranks;
  PartsResult parts;
  if (ranked) {
    ranks = run_ranks(settings, o.parts, context);
    if (launch().rank > 0) return;
    report_ranks(ranks.ranks, context);
  } else {
    parts = run_parts(settings, o.parts, context);
  }
  const SurfaceStats& stats = ranked ? ranks.surface : parts.surface;
  if (!settings.dry_run) {
    context.info(fmt::format("{} vertices, {} triangles in {:.1f} s ({:.2f} M samples per CPU second, {:.0f} MB)",
                             stats.vertices, stats.triangles, stats.wall,
                             static_cast<double>(stats.samples_read) / stats.cpu * 1e-6,
                             static_cast<double>(stats.peak_memory) * 1e-6));
    if (!parts.chunk) context.info(describe(stats.holes));
    const VolumeExportStats& v = stats.volume;
    if (v.voxel > 0) context.info(fmt::format("{} voxels of {:.4g}", count_text(v.voxels), v.voxel));
    if (v.files.size() == 1) context.info(fmt::format("{}: {}", v.files[0], bytes_text(v.bytes)));
    if (v.files.size() > 1)
      context.info(
          fmt::format("{} ... {}: {} files, {}", v.files.front(), v.files.back(), v.files.size(), bytes_text(v.bytes)));
  }
  if (!o.preview.empty() && !settings.dry_run) draw_preview(o, settings.output, context);
  if (!stats_file) return;
  nlohmann::ordered_json json = to_json(stats, settings);
  if (parts.chunk) {
    json.erase("holes");  // are known to the merge
    json["chunk"] = {{"number", o.parts.chunk.number},
                     {"count", o.parts.chunk.count},
                     {"first_slab", parts.chunk->first_slab},
                     {"slabs", parts.chunk->slabs},
                     {"overlap_slabs", parts.chunk->overlap_slabs},
                     {"samples", parts.chunk->samples}};
  }
  if (ranked) json["ranks"] = ranks_json(ranks.ranks);
  stats_file->write(json.dump(2) + "\n");
}

template <typename T>
CLI::CheckedTransformer words(const std::map<std::string, T>& map) {
  return CLI::CheckedTransformer(map, CLI::ignore_case);
}

void add_volume_options(CLI::App& tool, VolumeExport& v) {
  const std::string volume = "Volume";
  tool.add_option("--vdb", v.path, "write the signed distance as an OpenVDB level set, grid surface, too")
      ->type_name("OUT.vdb")
      ->group(volume);
  tool.add_option("--vdb-grids", v.grids,
                  "further grids: N, Cd, weight, curvature, any attribute; auto: Cd with colours")
      ->delimiter(',')
      ->expected(1, -1)
      ->option_text("NAME,... [auto]")
      ->group(volume);
  tool.add_option("--vdb-precision", v.half, "numbers of 16 or 32 bits")
      ->transform(words<bool>({{"half", true}, {"float", false}}))
      ->option_text("half|float [half]")
      ->group(volume);
  tool.add_option("--vdb-band", v.band, "half width of the band, voxels")->capture_default_str()->group(volume);
  tool.add_option("--vdb-voxelsize", v.voxel,
                  "edge of a voxel: the octree's nearest cell size is taken; 0: most cells'")
      ->capture_default_str()
      ->group(volume);
  tool.add_flag("--vdb-levels", v.levels, "one grid per level of the octree, surface_L0 the finest, for inspection")
      ->group(volume);
  tool.add_option_function<std::string>(
          "--vdb-split", [&v](const std::string& text) { v.split = parse_bytes(text); },
          "begin a new file, OUT.0001.vdb ..., after so many bytes of voxels in memory")
      ->type_name("SIZE")
      ->group(volume);
  tool.add_option("--vdb-points", v.points, "write the projected corners as an OpenVDB points grid (P, N, Cd, pscale)")
      ->type_name("OUT.vdb")
      ->group(volume);
}

}  // namespace

void add_surface(CLI::App& app) {
  auto* tool = app.add_subcommand("surface", "Reconstruct a triangle mesh from oriented points, streaming");
  auto o = std::make_shared<SurfaceOptions>();
  SurfaceSettings& s = o->settings;
  tool->add_option(
          "INPUT", o->inputs,
          "points with normals: PLY, OBJ, XYZ and other text, PTX, PCD, LAS, also gzipped; several files, "
          "folders, patterns or scan lists (.conf) are one cloud; FILE@POSE.txt moves a file by the 4x4 matrix "
          "in POSE.txt; - or stdin.ply for standard input")
      ->required();
  auto* output =
      tool->add_option("-o,--output", s.output, "mesh to write: binary PLY; - or stdout.ply for standard output");

  const std::string samples = "Samples";
  tool->add_option("--columns", s.columns,
                   "what the columns of text files hold: names as in x,y,z,nx,ny,nz,red:uchar,-, - for those to skip")
      ->type_name("NAMES")
      ->group(samples);
  tool->add_option("--frame", s.frame, "pca: sweep along the dominant axis; axis: along the longest input axis")
      ->transform(words<FrameMode>({{"pca", FrameMode::pca}, {"axis", FrameMode::axis}}))
      ->option_text("pca|axis [pca; axis with --vdb]")
      ->group(samples);
  tool->add_option("--bad-samples", s.bad_samples, "non-finite, no normal, radius <= 0: leave out, or refuse the file")
      ->transform(words<BadSamples>({{"drop", BadSamples::drop}, {"refuse", BadSamples::refuse}}))
      ->option_text("drop|refuse [drop]")
      ->group(samples);
  tool->add_option("--particlescale", s.radius_scale, "multiplies every sample's radius, given or estimated")
      ->capture_default_str()
      ->group(samples);
  tool->add_option("--density", s.density, "samples a counting cell needs to give a radius")
      ->capture_default_str()
      ->group(samples);
  add_length(*tool, "--max-radius", s.max_radius, "discard samples with a larger radius as undersampled; 0: none")
      ->group(samples);

  add_clean_options(*tool, s.clean, "Cleaning");
  add_normals_choice(*tool, s.normals, "Normals");
  add_normals_options(*tool, s.normal_search, "Normals");

  const std::string fit = "Fit";
  add_choice(*tool, "--blend", s.blend, fmt::format("{:g}", *s.blend),
             "H: the influence radius R is H times a sample's radius r; auto: H, and --cell and --refit where these "
             "are not given, by the cloud's noise and the evenness of its sampling")
      ->group(fit);
  add_choice(*tool, "--refit", s.refit, "0, with --blend auto: auto",
             "first replace normals by those fitted to the samples within so many radii; 0: keep them; auto: keep "
             "them but for noise that --blend auto finds")
      ->group(fit);
  const auto take_steps = [&s](const std::string& text) {
    s.steps = 0;
    if (text != "auto" && (!CLI::detail::lexical_cast(text, s.steps) || s.steps < 1))
      throw CLI::ValidationError("--steps", text + ": is neither a number in 1..16 nor auto");
  };
  tool->add_option_function<std::string>("--steps", take_steps,
                                         "N: projection steps; auto: as many as each corner needs")
      ->option_text("N|auto [1]")
      ->group(fit);
  tool->add_option("--step-tolerance", s.step_tolerance,
                   "with --steps auto: a corner is done when a step moves it no more than so many radii r")
      ->capture_default_str()
      ->group(fit);
  tool->add_option("--fit", s.fit, "surface fitted to the samples around a corner")
      ->transform(words<FitMode>({{"plane", FitMode::plane}, {"sphere", FitMode::sphere}}))
      ->option_text("plane|sphere [sphere]")
      ->group(fit);
  tool->add_flag("--diffuse", s.diffuse, "project cell centres and average them at the corners: smoother")->group(fit);

  const std::string lattice = "Octree";
  tool->add_option_function<std::string>(
          "--cell", [&s](const std::string& text) { s.cell = length_of("--cell", text); },
          "largest leaf cell: a length, or times the smallest r or R around")
      ->option_text("LENGTH [0.9R, with --blend auto: chosen]")
      ->group(lattice);
  tool->add_option("--levels", s.levels, "octree levels; 0: as the radii ask, at least 4")
      ->capture_default_str()
      ->group(lattice);

  const std::string mesh = "Mesh";
  tool->add_option(
          "--boundary", s.boundary,
          "reject where the projection lies farther than this (in R) from the average of its samples; 0: never")
      ->capture_default_str()
      ->group(mesh);
  tool->add_option("--cluster", s.cluster, "vertex clustering; free may change the topology")
      ->transform(words<ClusterMode>(
          {{"none", ClusterMode::none}, {"free", ClusterMode::free}, {"preserving", ClusterMode::preserving}}))
      ->option_text("none|free|preserving [preserving]")
      ->group(mesh);
  tool->add_option("--chord", s.chord, "outward shift of clustered vertices, times curvature and cell squared")
      ->capture_default_str()
      ->group(mesh);
  tool->add_flag("--level", s.vertex_levels,
                 "give vertices their octree level, 0 the finest, as property level; 'lamina render --paint level'")
      ->group(mesh);

  tool->add_flag("--curvature", s.vertex_curvature,
                 "give vertices the mean curvature, 1 / length, as property curvature; convex is positive")
      ->group(mesh);

  add_hole_options(*tool, s, mesh);
  tool->add_option("--prune", s.prune_triangles, "leave out connected parts of fewer triangles")
      ->type_name("N")
      ->capture_default_str()
      ->group(mesh);
  add_length(*tool, "--prune-size", s.prune_size, "leave out parts whose box has a shorter diagonal; 0: none")
      ->group(mesh);
  tool->add_flag("--local", s.local, "write coordinates less a round shift, for programs that read floats")
      ->group(mesh);

  add_volume_options(*tool, s.volume);
  add_parts_options(*tool, o->parts);

  tool->add_option("--window", s.window, "slabs each stage advances at once")->capture_default_str()->group("Run");
  auto* dry =
      tool->add_flag("--dry-run", s.dry_run, "print levels, slabs, expected memory, disk and time; write nothing")
          ->group("Run");
  tool->add_option("--preview", o->preview, "draw the finished mesh; one too large to be held as its vertices")
      ->type_name("OUT.png")
      ->group("Run");
  tool->add_option("--stats", o->stats, "write counts, times and memory to this JSON file, - for standard output")
      ->type_name("FILE.json")
      ->group("Run");
  add_run_options(*tool, o->run);
  add_examples(*tool,
               "  lamina surface scan.ply -o mesh_of_scan.ply\n"
               "  lamina surface scan.ply --dry-run");
  tool->callback([o, tool, output, dry] {
    if (o->parts.tasks > 0) return print_tasks(*tool, o->inputs.front(), o->settings.output, o->parts);
    if (output->count() == 0 && dry->count() == 0) throw CLI::RequiredError("--output");
    run_surface(*o);
  });
}

}  // namespace lamina::tools

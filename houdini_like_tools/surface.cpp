// lamina surface: oriented points in, streamed triangle mesh out.
#include "lamina/surface.h"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "common/console.h"
#include "common/help.h"
#include "common/inputs.h"
#include "common/model.h"
#include "common/option_values.h"
#include "common/outputs.h"
#include "common/parts.h"
#include "common/point_options.h"
#include "common/stats.h"
#include "common/surface_options.h"
#include "common/text.h"
#include "lamina/error.h"
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
  if (!o.parts.chunked) require_mesh_name(settings.output);
  if (o.stats == "-" && settings.output == "-") {
    throw Error(ExitCode::usage, "--stats and --output both name standard output; give one of them a file");
  }
  if (!o.preview.empty() && settings.output == "-")
    throw Error(ExitCode::usage, "--preview draws the mesh file; give --output one");
  if (!o.preview.empty() && o.parts.chunked)
    throw Error(ExitCode::usage, "--preview draws a mesh, --chunk makes only a part of one");
  if (!o.preview.empty() && o.preview == settings.output)
    throw Error(ExitCode::usage, "--preview and --output name the same file");
  require_picture_name(o.preview);
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
  nlohmann::ordered_json json = stats_json(stats, settings);
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
  auto* output = tool->add_option(
      "-o,--output", s.output,
      "mesh to write: binary PLY, named .ply; - or stdout.ply for standard output (| lamina convert - -o mesh.obj)");

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

  add_fit_options(*tool, s);

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

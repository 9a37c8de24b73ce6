// lamina surface: oriented points in, streamed triangle mesh out.
#include "surface.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "common/console.h"
#include "common/help.h"
#include "common/inputs.h"
#include "common/model.h"
#include "common/options.h"
#include "common/outputs.h"
#include "common/parts.h"
#include "common/presets.h"
#include "common/stats.h"
#include "common/text.h"
#include "lamina/error.h"
#include "lamina/file_ending.h"
#include "tool.h"

namespace lamina::tools {
namespace {

/// A picture of the mesh file: of its triangles where they can be held, of its vertices where they cannot.
void draw_preview(const SurfaceOptions& o, const std::string& mesh, const RunContext& context) {
  // Positions become doubles, and normals, projected vertices and lists of triangles come on top.
  constexpr std::uintmax_t kBytesPerByte = 4;
  constexpr std::uintmax_t kPicture = std::uintmax_t{48} << 20;
  constexpr std::uintmax_t kUnasked = std::uintmax_t{1} << 30;  // where no limit was given
  const std::uintmax_t most = context.max_memory > 0 ? context.max_memory : kUnasked;
  const bool whole = kPicture + kBytesPerByte * std::filesystem::file_size(mesh) <= most;
  const std::string ending = file_ending(mesh);
  if (!whole && ending != ".ply" && ending != ".obj") {
    context.warn(
        fmt::format("{}: not drawn: the mesh is too large to be held for a picture, and only the vertices of "
                    "a .ply or .obj can be drawn as they are read",
                    o.preview));
    return;
  }
  Renderer renderer({}, context);
  const std::unique_ptr<Model> model = whole ? open_model(mesh, {}, context) : open_vertices(mesh, context);
  model->frame(renderer);
  model->draw(renderer);
  write_png(renderer.finish(), o.preview);
  context.info(fmt::format("{}: drew {}{}", o.preview, model->what(),
                           whole ? "" : ", the vertices: the mesh is too large to be held for a picture"));
}

/// What --prune says.
std::optional<std::uint64_t> triangles_of(const std::optional<double>& number) {
  if (!number) return std::nullopt;
  constexpr double kMost = 1e15;
  if (!(*number >= 0 && *number <= kMost) || *number != std::floor(*number))
    throw CLI::ValidationError("--prune", fmt::format("{:g}: is neither a whole number nor auto", *number));
  return static_cast<std::uint64_t>(*number);
}

bool reads_store(const SurfaceOptions& o) {
  return !o.inputs.empty() && is_store(o.inputs.front());
}

/// What is chosen where the user says nothing, and nothing is chosen with --raw. A store has been cleaned, and given
/// normals, when it was made; ranks that share out an input's rows cannot look around.
void choose_what_is_not_given(const SurfaceOptions& o, SurfaceSettings& settings) {
  const auto given = [&o](const char* option) { return o.tool->count(option) > 0; };
  if (o.raw) {
    if (!given("--normals")) settings.normals = NormalsChoice::file;
    if (!given("--blend")) settings.blend = SurfaceSettings{}.blend;
    if (!given("--prune")) settings.prune_triangles = 0;
    if (!given("--close-holes")) settings.close_holes = SurfaceSettings{}.close_holes;
    if (!given("--deviation")) settings.deviation = SurfaceSettings{}.deviation;
    return;
  }
  if (reads_store(o)) return;
  if (!given("--align")) settings.align = true;
  if (!given("--strays")) settings.clean.strays = launch().size == 1;
}

/// The file of the mesh that is drawn: one that can be read as it streams, if there is one. Empty where nothing but
/// standard output is written.
std::string file_to_draw(const std::vector<std::string>& outputs) {
  std::string file;
  for (const std::string& output : outputs) {
    if (output == "-") continue;
    if (file_ending(output) == ".ply") return output;
    if (file.empty()) file = output;
  }
  return file;
}

void require_outputs(const SurfaceOptions& o, const std::vector<std::string>& outputs) {
  const bool streams = std::find(outputs.begin(), outputs.end(), "-") != outputs.end();
  if (o.parts.chunked && outputs.size() > 1)
    throw Error(ExitCode::usage, "--chunk makes one part of a mesh; give one --output, and lamina merge the others");
  if (!o.parts.chunked) std::for_each(outputs.begin(), outputs.end(), require_mesh_name);
  if (o.stats == "-" && streams)
    throw Error(ExitCode::usage, "--stats and --output both name standard output; give one of them a file");
  if (o.preview.empty()) return;
  if (streams && file_to_draw(outputs).empty())
    throw Error(ExitCode::usage, "--preview draws the mesh file; give --output one");
  if (o.parts.chunked) throw Error(ExitCode::usage, "--preview draws a mesh, --chunk makes only a part of one");
  if (std::find(outputs.begin(), outputs.end(), o.preview) != outputs.end())
    throw Error(ExitCode::usage, "--preview and --output name the same file");
}

/// A store's points are what they are. Ranks do not clean; meshes made in parts are not pruned.
void take_preset(const SurfaceOptions& o, const RunContext& context) {
  const bool stored = reads_store(o);
  const bool ranked = launch().size > 1;
  const bool in_parts = ranked || o.parts.chunked || !o.parts.checkpoint.directory.empty();
  const auto takes = [&](PresetPart part) {
    if (part == PresetPart::points) return !stored;
    if (part == PresetPart::cleaning) return !stored && !ranked;
    return part == PresetPart::mesh || !in_parts;
  };
  apply_preset(*o.tool, *o.preset, takes, context);
}

void run_surface(SurfaceOptions& o) {
  SurfaceSettings settings = surface_settings(o, make_context(o.run));
  settings.input = pipe_name(o.inputs.front());
  for (auto name = o.inputs.begin() + 1; name != o.inputs.end(); ++name)
    settings.more_inputs.push_back(pipe_name(*name));
  std::vector<std::string> outputs;
  for (const std::string& name : o.outputs) outputs.push_back(pipe_name(name));
  require_outputs(o, outputs);
  if (!outputs.empty()) {
    settings.output = outputs.front();
    settings.more_outputs.assign(outputs.begin() + 1, outputs.end());
  }
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
    if (stats.simplified.triangles_before > 0 && !parts.chunk)
      report_simplified(stats.simplified, settings.input, context);
    const VolumeExportStats& v = stats.volume;
    if (v.voxel > 0) context.info(fmt::format("{} voxels of {:.4g}", count_text(v.voxels), v.voxel));
    if (v.files.size() == 1) context.info(fmt::format("{}: {}", v.files[0], bytes_text(v.bytes)));
    if (v.files.size() > 1)
      context.info(
          fmt::format("{} ... {}: {} files, {}", v.files.front(), v.files.back(), v.files.size(), bytes_text(v.bytes)));
    if (stats.tiles.tiles > 0) context.info(tiles_text(stats.tiles));
  }
  if (!o.preview.empty() && !settings.dry_run) draw_preview(o, file_to_draw(outputs), context);
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

SurfaceSettings surface_settings(SurfaceOptions& o, const RunContext& context) {
  if (o.preset) take_preset(o, context);
  SurfaceSettings settings = o.settings;
  settings.guess_trade = !o.preset && !o.raw;
  if (o.simplify.given()) settings.simplify = simplify_settings(o.simplify);
  choose_what_is_not_given(o, settings);
  return settings;
}

void add_surface_options(CLI::App& tool, SurfaceOptions& o) {
  SurfaceSettings& s = o.settings;
  o.tool = &tool;
  s.blend.reset();
  s.prune_triangles.reset();
  s.deviation.reset();
  add_preset(tool, o.preset, "Trade");

  const std::string samples = "Samples";
  add_point_options(tool, s.reading, samples);
  tool.add_option("--frame", s.frame,
                  "pca: sweep along the cloud's dominant axis, for the least memory; axis: along the longest input "
                  "axis, so that "
                  "voxels lie along the input's axes")
      ->transform(words<FrameMode>({{"pca", FrameMode::pca}, {"axis", FrameMode::axis}}))
      ->option_text("pca|axis [pca; axis with --vdb]")
      ->group(samples);
  tool.add_option("--bad-samples", s.bad_samples,
                  "Samples that are not finite, have no normal or a radius of 0 or less: leave out, or refuse the file")
      ->transform(words<BadSamples>({{"drop", BadSamples::drop}, {"refuse", BadSamples::refuse}}))
      ->option_text("drop|refuse [drop]")
      ->group(samples);
  tool.add_option("--particlescale", s.radius_scale,
                  "Multiply every sample's radius, given or estimated, by K; up to 1000")
      ->type_name("K")
      ->capture_default_str()
      ->group(samples);
  tool.add_option("--density", s.density, "Samples a counting cell needs to give a radius, 2 to 4096")
      ->type_name("N")
      ->capture_default_str()
      ->group(samples);
  add_length(tool, "--max-radius", s.max_radius,
             "Discard samples with a larger radius as undersampled; r is the median radius here; 0: none")
      ->group(samples);

  add_align(tool, s.align, samples);
  add_clean_options(tool, s.clean, "Cleaning");
  tool.add_option("--rejected", s.rejected,
                  "Write the samples left out by these steps, strays above all, to a point file, with their attributes "
                  "and one more, reason")
      ->type_name("FILE")
      ->group("Cleaning");
  add_normals_choice(tool, s.normals, "Normals");
  add_normals_options(tool, s.normal_search, "Normals");

  tool.add_flag(
          "--raw", o.raw,
          "Choose nothing: the file's normals, all samples, --blend 1.2, --prune 0, --deviation 0, where these are not "
          "given")
      ->excludes(tool.get_option("--preset"))
      ->group("Fit");
  add_fit_options(tool, s);

  const std::string mesh = "Mesh";
  tool.add_option("--boundary", s.boundary,
                  "Reject the surface where the projection lies farther than K influence radii R from the average of "
                  "its samples; "
                  "0: never")
      ->type_name("K")
      ->capture_default_str()
      ->group(mesh);
  tool.add_option_function<double>(
          "--trim", [&s](double level) { s.trim = level; },
          "Cut the mesh where it reaches K influence radii R beyond its samples; 0.235 is the edge of evenly spread "
          "ones; 0: keep or leave out whole triangles [chosen where --blend is, else 0]")
      ->type_name("K")
      ->group(mesh);
  tool.add_option("--cluster", s.cluster,
                  "Vertex clustering: none, preserving the topology, or free, which may change it")
      ->transform(words<ClusterMode>(
          {{"none", ClusterMode::none}, {"free", ClusterMode::free}, {"preserving", ClusterMode::preserving}}))
      ->option_text("none|free|preserving [preserving]")
      ->group(mesh);
  tool.add_option("--chord", s.chord,
                  "Outward shift of clustered vertices: K times the curvature times the cell squared; 0 to 1")
      ->type_name("K")
      ->capture_default_str()
      ->group(mesh);
  tool.add_flag(
          "--level", s.vertex_levels,
          "Give vertices their octree level, 0 the finest, as property level: 'lamina render mesh.ply --paint level'")
      ->group(mesh);

  tool.add_flag("--curvature", s.vertex_curvature,
                "Give vertices the mean curvature (1 / length, positive where convex) as property curvature; needs "
                "the sphere fit")
      ->group(mesh);

  add_hole_options(tool, s, mesh);
  add_number_or_auto(tool, "--prune", "auto",
                     "Leave out connected parts of fewer than N triangles; 0: none; auto: those under which fewer than "
                     "60 samples lie, or than one in 5000 of a small cloud, and none where the mesh is made in parts",
                     [&s](const std::optional<double>& number) { s.prune_triangles = triangles_of(number); })
      ->option_text("N|auto [auto]")
      ->group(mesh);
  add_length(tool, "--prune-size", s.prune_size,
             "Leave out connected parts whose box has a shorter diagonal; r is the median radius here; 0: none")
      ->group(mesh);
  tool.add_flag("--local", s.local,
                "Subtract a round shift from the coordinates, for programs that read floats; the statistics, the "
                "PLY's comment "
                "shift and the .vdb's metadata shift name it")
      ->group(mesh);

  const std::string simplification = "Simplification";
  add_simplify_goal(tool, o.simplify, simplification);
  tool.get_option("--triangles")
      ->description(
          "How many triangles stay, at most those there are; cells are made so fine that there are about twice as "
          "many first, where the samples have the detail");
  auto* deviation = add_number_or_auto(
      tool, "--deviation", "auto",
      "Leave out triangles where the surface is flat: within K lengths of an edge there, root mean square; boundaries "
      "stay, and so does detail of colours and other attributes; 0: all triangles stay; auto: by the cloud's noise, "
      "0.01 to 0.05; with --raw 0",
      [&s](const std::optional<double>& number) { s.deviation = number; });
  deviation->option_text("K|auto [auto]")->group(simplification);
  for (const char* other : {"--error", "--triangles", "--ratio"}) deviation->excludes(tool.get_option(other));
  add_volume_options(tool, s.volume);
  const std::string tiles = "Tiles";
  tool.add_option("--tiles", s.tiles.folder,
                  "Also write 3D Tiles, levels of detail for viewers, into this folder, which is made or empty")
      ->type_name("DIR")
      ->group(tiles);
  tool.add_flag("!--tiles-plain", s.tiles.compress, "Their contents without compression (EXT_meshopt_compression)")
      ->group(tiles);
  add_parts_options(tool, o.parts);

  tool.add_option("--window", s.window,
                  "Slabs each stage advances at once, 1 to 1024; more keeps many cores busier and takes memory")
      ->type_name("N")
      ->capture_default_str()
      ->group("Run");
  tool.add_flag("--dry-run", s.dry_run, "Print levels, slabs, expected memory, disk and time; write nothing")
      ->group("Run");
  tool.add_option(
          "--preview", o.preview,
          "Draw the finished mesh; as its vertices where it is too large to be held: four times its file within "
          "--max-memory, or 1 GB")
      ->type_name("OUT.png")
      ->group("Run");
  tool.add_option("--stats", o.stats, "Write counts, times and memory to this JSON file; - for standard output")
      ->type_name("FILE.json")
      ->group("Run");
  add_run_options(tool, o.run);
}

void add_surface(CLI::App& app) {
  auto* tool = app.add_subcommand("surface", "Reconstruct a triangle mesh from oriented points, streaming");
  auto o = std::make_shared<SurfaceOptions>();
  tool->add_option(
          "INPUT", o->inputs,
          "Points with normals: PLY, OBJ, XYZ and other text, PTX, PCD, LAS, LAZ, E57, points of a .vdb, also gzipped; "
          "several "
          "files, folders, patterns or scan lists (.conf) are one cloud; FILE@POSE.txt moves a file by the 4x4 matrix "
          "in POSE.txt. Or a store that lamina sort --store made. - for PLY on standard input")
      ->required()
      ->type_name("");
  auto* output = tool->add_option(
      "-o,--output", o->outputs,
      "Mesh to write: .ply, binary and streamed; .obj, .off, .stl or .glb, written when the mesh is complete; - for "
      "PLY "
      "on standard output. Several -o write it in several formats. Not needed with --dry-run and --print-tasks");
  output->type_name("FILE")->allow_extra_args(false);

  add_surface_options(*tool, *o);
  add_notes(
      *tool,
      "Of a point it takes x y z nx ny nz, radius or pscale, quality or confidence; every other property arrives at "
      "the "
      "vertices in its own type. Without radii they come from the local density. Memory goes with the cross-section of "
      "the cloud, not with its length, and the mesh is the same bytes for any number of threads, chunks and ranks.\n"
      "With --vdb the signed distance that the mesh is extracted from is written as well: a level set in the input's "
      "coordinates. It exists only near data; where the surface is open its metadata say so (open), and voxels far "
      "from "
      "any data count as outside. Voxels have the size of most cells, values of finer and coarser cells are resampled "
      "to "
      "them. It is written slab by slab: one file, however large the cloud.\n"
      "Under mpirun several processes work on one mesh; --threads and --max-memory are each one's own. --vdb, cleaning "
      "(but that of a store), pruning, --local, --checkpoint, --chunk, --dry-run and standard output are for runs "
      "without it.");
  add_examples(*tool,
               "  lamina surface scan.ply -o mesh_of_scan.ply\n"
               "  lamina surface scan.ply -o mesh_of_scan.stl\n"
               "  lamina surface scan.ply -o for_archive.ply -o for_viewers.glb\n"
               "  lamina surface scan.ply --dry-run\n"
               "  lamina surface scan.ply --preset photogrammetry --prune 50 -o mesh_of_photos.ply\n"
               "  lamina surface scan.ply -o smooth.ply --blend 2 --vdb smooth.vdb --stats smooth.json");
  tool->parse_complete_callback([o, output, dry = tool->get_option("--dry-run")] {
    if (output->count() == 0 && dry->count() == 0 && o->parts.tasks == 0) throw CLI::RequiredError("--output");
  });
  tool->callback([o, tool] {
    if (o->parts.tasks > 0) return print_tasks(*tool, o->inputs.front(), o->outputs, o->parts);
    run_surface(*o);
  });
}

}  // namespace lamina::tools

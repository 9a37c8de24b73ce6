// lamina merge: several clouds, meshes or volumes in one file.
#include "lamina/edit.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>
#include <optional>

#include "common/console.h"
#include "common/help.h"
#include "common/inputs.h"
#include "common/options.h"
#include "common/outputs.h"
#include "common/text.h"
#include "lamina/chunk.h"
#include "lamina/error.h"
#include "lamina/volume_tools.h"
#include "tables.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct MergeOptions {
  std::vector<std::string> inputs, outputs;
  std::string output;  ///< the first
  PointSettings reading;
  MixedAttributes mixed = MixedAttributes::refuse;
  BadSamples bad = BadSamples::drop;
  Precision precision = Precision::automatic;
  SimplifyGoal simplify;
  RunOptions run;
};

void merge_points(const MergeOptions& o, const std::vector<PointInput>& inputs, const RunContext& context) {
  std::vector<std::unique_ptr<PointSource>> sources;
  std::vector<const PointSourceInfo*> infos;
  std::string crs;
  for (const PointInput& input : inputs) {
    auto source = open_point_input(input.path, o.reading, context);
    sources.push_back(input.posed ? pose_points(std::move(source), input.pose) : std::move(source));
    infos.push_back(&sources.back()->info());
    if (infos.size() == 1) crs = infos[0]->crs;
    if (infos.back()->crs == crs && infos.back()->geographic == infos[0]->geographic) continue;
    if (o.reading.project_degrees) {
      throw Error(ExitCode::usage,
                  fmt::format("{}: its degrees come into another plane than those of {}, as whole degrees lie between; "
                              "merge the files first, and project the result",
                              shown_name(input.path), shown_name(inputs.front().path)));
    }
    if (!crs.empty()) {
      context.warn(fmt::format("{}: has another coordinate reference system than {}; the result names none",
                               shown_name(input.path), shown_name(inputs.front().path)));
    }
    crs.clear();
  }
  const auto writer =
      open_points_writer(o.output, with_precision(merged_columns(infos, o.mixed), o.precision),
                         {.count = {}, .tmp_dir = o.run.tmp_dir, .crs = crs, .geographic = infos[0]->geographic});
  for (const auto& source : sources)
    warn_of_bad_rows(append_points(*source, *writer, o.bad, context), shown_name(source->info().path), context);
  writer->commit();
  context.info(fmt::format("{} points of {} files", count_text(writer->rows()), sources.size()));
}

void merge_triangles(const MergeOptions& o, const std::vector<PointInput>& inputs, const RunContext& context) {
  std::vector<TriangleMesh> meshes;
  std::vector<std::string> names;
  for (const PointInput& input : inputs) {
    if (input.posed)
      throw Error(ExitCode::usage, input.path + ": is a mesh; only points are moved by a pose, see 'lamina transform'");
    names.push_back(shown_name(input.path));
    meshes.push_back(read_mesh_input(input.path, context, o.bad));
  }
  const TriangleMesh merged = merge_meshes(std::move(meshes), names, o.mixed);
  write_mesh(merged, o.output);
  context.info(fmt::format("{} vertices, {} triangles of {} files", count_text(merged.positions.size()),
                           count_text(merged.triangles.size()), inputs.size()));
}

void merge_grids(const MergeOptions& o, const std::vector<PointInput>& inputs, const RunContext& context) {
  std::vector<std::string> names;
  for (const PointInput& input : inputs) {
    if (input.posed) throw Error(ExitCode::usage, input.path + ": is a volume; only points are moved by a pose");
    names.push_back(input.path);
  }
  require_volume_name(o.output);
  const VolumeMergeStats stats = merge_volumes(names, o.output, context);
  const std::string points = stats.points > 0 ? ", " + count_text(stats.points) + " points" : std::string();
  context.info(
      fmt::format("{} grids, {} voxels{}, {}", stats.grids, count_text(stats.voxels), points, bytes_text(stats.bytes)));
}

void merge_chunks(const MergeOptions& o, const RunContext& context) {
  std::for_each(o.outputs.begin(), o.outputs.end(), require_mesh_name);
  std::optional<SimplifySettings> simplify;
  if (o.simplify.deviation == 0.0) {
    simplify.emplace();
  } else if (o.simplify.given()) {
    simplify = simplify_settings(o.simplify);
  }
  const MergedParts merged = merge_parts(o.inputs, o.outputs, context, simplify);
  context.info(fmt::format("{} vertices, {} triangles of {} parts", count_text(merged.vertices),
                           count_text(merged.triangles), merged.parts));
  context.info(describe(merged.holes));
  if (merged.simplified.triangles_before > 0) report_simplified(merged.simplified, shown_name(o.output), context);
}

void run_merge(const MergeOptions& o) {
  const RunContext context = make_context(o.run, o.output);
  if (std::any_of(o.inputs.begin(), o.inputs.end(), is_part)) return merge_chunks(o, context);
  if (o.simplify.given())
    throw Error(ExitCode::usage,
                "--error, --triangles, --ratio and --deviation are for the parts of a mesh; see 'lamina simplify'");
  if (o.outputs.size() > 1)
    throw Error(ExitCode::usage, "several --output are for the parts of a mesh; name one, and convert it");
  const auto word = [](FileContent content) {
    return content == FileContent::points ? "points" : content == FileContent::mesh ? "a mesh" : "a volume";
  };
  const std::vector<PointInput> inputs = expand_inputs(o.inputs);
  std::optional<FileContent> first;
  for (const PointInput& input : inputs) {
    const FileContent content = content_of(input.path, o.run.tmp_dir);
    if (!first) first = content;
    if (content != *first)
      throw Error(ExitCode::usage,
                  fmt::format("{} holds {}, {} holds {}: only files of a kind can be merged",
                              shown_name(inputs.front().path), word(*first), shown_name(input.path), word(content)));
  }
  if (std::count_if(inputs.begin(), inputs.end(), [](const PointInput& i) { return i.path == "-"; }) > 1)
    throw Error(ExitCode::usage, "two inputs name standard input; give one of them a file");
  if (first == FileContent::volume) return merge_grids(o, inputs, context);
  first == FileContent::points ? merge_points(o, inputs, context) : merge_triangles(o, inputs, context);
}

}  // namespace

void add_merge(CLI::App& app) {
  auto* tool = app.add_subcommand("merge", "Put several clouds, meshes, volumes or the parts of a mesh into one file");
  auto o = std::make_shared<MergeOptions>();
  tool->add_option_function<std::vector<std::string>>(
          "INPUT",
          [o](const std::vector<std::string>& names) {
            for (const std::string& name : names) o->inputs.push_back(pipe_name(name));
          },
          "Points (streamed) or meshes, in the order in which they are to stand: files, folders, patterns, scan lists "
          "(.conf), FILE@POSE.txt; - for PLY on standard input. Or all parts of a mesh that lamina surface --chunk "
          "made, in any order")
      ->required()
      ->expected(1, 1000000)
      ->type_name(" ");
  tool->add_option_function<std::vector<std::string>>(
          "-o,--output",
          [o](const std::vector<std::string>& names) {
            for (const std::string& name : names) o->outputs.push_back(pipe_name(name));
            o->output = o->outputs.front();
          },
          "File of the same kind, by its ending; - for PLY on standard output. Of the parts of a mesh several -o write "
          "it in several formats")
      ->required()
      ->allow_extra_args(false)
      ->type_name("FILE")
      ->group("Output");
  const std::map<std::string, MixedAttributes> words{
      {"refuse", MixedAttributes::refuse}, {"fill", MixedAttributes::fill}, {"intersect", MixedAttributes::intersect}};
  tool->add_option_function<std::string>(
          "--mixed", [o, words](const std::string& word) { o->mixed = words.at(word); },
          "Attributes that not all inputs have: refuse, naming them; fill with 0; intersect: leave out [refuse]")
      ->check(CLI::IsMember({"refuse", "fill", "intersect"}).description(""))
      ->type_name("refuse|fill|intersect")
      ->group("Input");
  add_point_options(*tool, o->reading);
  add_bad_samples(*tool, o->bad, "Points and vertices");
  add_precision(*tool, o->precision);
  add_simplify_goal(*tool, o->simplify, "Parts of a mesh");
  auto* deviation = add_number_or_auto(*tool, "--deviation", "auto",
                                       "Leave out triangles where the surface is flat, as lamina surface does; 0: all "
                                       "triangles stay; auto: as the parts "
                                       "say",
                                       [o](const std::optional<double>& number) { o->simplify.deviation = number; });
  deviation->option_text("K|auto [auto]")->group("Parts of a mesh");
  for (const char* other : {"--error", "--triangles", "--ratio"}) deviation->excludes(tool->get_option(other));
  add_run_options(*tool, o->run);
  add_notes(
      *tool,
      "Points and meshes follow one another in the order given. Volumes are united: the files of a --vdb-split "
      "sequence, level sets as solids, grids of other names side by side; the result is held in memory. The parts of "
      "lamina surface --chunk are joined to the one mesh, streaming; a part that is missing, there twice, damaged or "
      "of another run is named. Points stream, meshes are held.");
  add_examples(*tool,
               "  lamina merge scan.ply more.ply -o both.ply\n"
               "  lamina merge scan.ply plain.ply --mixed intersect -o common.ply");
  tool->callback([o] { run_merge(*o); });
}

}  // namespace lamina::tools

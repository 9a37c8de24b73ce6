// lamina normal: normals for points that have none, and one side for all of them.
#include "lamina/normals.h"

#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "common/console.h"
#include "common/help.h"
#include "common/inputs.h"
#include "common/options.h"
#include "common/outputs.h"
#include "common/presets.h"
#include "common/stats.h"
#include "lamina/edit.h"
#include "lamina/error.h"
#include "tables.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct NormalOptions {
  std::vector<std::string> inputs;
  std::string output, stats;
  PointSettings reading;
  NormalFinding finding;
  Precision precision = Precision::automatic;
  CLI::App* tool = nullptr;  ///< knows which options were given
  RunOptions run;
};

NormalsMode mode_of(const NormalFinding& o) {
  if (int{o.reorient} + int{o.check} + int{o.missing} > 1)
    throw Error(ExitCode::usage, "--reorient, --missing and --check exclude each other");
  if (o.check) return NormalsMode::check;
  if (o.reorient) return NormalsMode::reorient;
  return o.missing ? NormalsMode::complete : NormalsMode::estimate;
}

void run_normal(NormalOptions& o) {
  NormalsSettings settings = normals_settings(*o.tool, o.finding, make_context(o.run, o.output));
  if (!o.finding.check && o.output.empty()) throw CLI::RequiredError("--output");
  if (o.finding.check && !o.output.empty())
    throw Error(ExitCode::usage, "--check writes no points; leave --output out");
  if (o.stats == "-" && o.output == "-")
    throw Error(ExitCode::usage, "--stats and --output both name standard output; give one of them a file");
  const RunContext context = make_context(o.run, o.output);
  std::vector<std::string> names;
  for (const std::string& name : o.inputs) names.push_back(pipe_name(name));
  PointSettings reading = o.reading;
  reading.tmp_dir = context.tmp_dir;
  reading.all_fields = true;
  std::unique_ptr<PointSource> source = open_points(names, reading);
  for (const std::string& remark : source->info().remarks) context.info(remark);
  const std::string path = shown_name(source->info().path);
  require_no_degrees(source->info());
  if (!o.finding.preset && !o.finding.check) guess_facing(source->info(), settings, context);
  PointColumns columns = with_precision(columns_of(source->info()), o.precision);
  columns.normals = true;
  // An output that cannot be written is better known before the work.
  std::unique_ptr<PointsWriter> writer;
  if (!o.output.empty())
    writer = open_points_writer(
        o.output, columns,
        {.count = {}, .tmp_dir = o.run.tmp_dir, .crs = source->info().crs, .geographic = source->info().geographic});
  std::optional<ResultFile> stats_file;
  if (!o.stats.empty()) stats_file.emplace(o.stats);
  NormalsReport report;
  source = with_normals(std::move(source), settings, report, context);
  if (writer) {
    const EditReport rows = edit_points(*source, *writer, {}, settings.bad_samples, context);
    warn_of_bad_rows(rows, path, context);
    writer->commit();
  }
  context.info(describe(report));
  warn_of_conflicts(report, path, context);
  if (stats_file) stats_file->write(normals_json(report).dump(2) + "\n");
}

}  // namespace

NormalsSettings normals_settings(CLI::App& tool, const NormalFinding& finding, const RunContext& context) {
  if (finding.preset) {
    const auto points_only = [](PresetPart part) { return part == PresetPart::points; };
    apply_preset(tool, *finding.preset, points_only, context);
  }
  NormalsSettings settings = finding.settings;
  settings.mode = mode_of(finding);
  return settings;
}

void guess_facing(const PointSourceInfo& info, NormalsSettings& settings, const RunContext& context) {
  const TradeGuess guess = guess_trade(info);
  context.info(describe(guess));
  face_by_trade(guess.trade, settings);
}

void add_normal_finding(CLI::App& tool, NormalFinding& finding) {
  const std::string group = "Normals";
  tool.add_flag("--reorient", finding.reorient, "Keep the directions the input has, change signs only")->group(group);
  tool.add_flag("--missing", finding.missing, "Keep the normals the input has, find those it lacks")->group(group);
  tool.add_flag("--check", finding.check, "Change and write nothing: tell the share of sign conflicts")->group(group);
  add_preset(tool, finding.preset, group);
  add_normals_options(tool, finding.settings, group);
}

void add_normal(CLI::App& app) {
  auto* tool = app.add_subcommand("normal", "Find normals of points, or turn those they have to one side");
  auto o = std::make_shared<NormalOptions>();
  o->tool = tool;
  tool->add_option(
          "INPUT", o->inputs,
          "Points of any format; several files, folders, patterns or scan lists are one cloud; - for PLY on standard "
          "input")
      ->required()
      ->type_name("");
  tool->add_option_function<std::string>(
          "-o,--output", [o](const std::string& name) { o->output = pipe_name(name); },
          "Points to write: .ply .xyz .csv .pcd .las .laz .e57; - for PLY on standard output. Samples that lie on no "
          "surface "
          "have the "
          "normal 0 0 0")
      ->type_name("FILE")
      ->group("Output");
  add_normal_finding(*tool, o->finding);
  add_point_options(*tool, o->reading);
  add_bad_samples(*tool, o->finding.settings.bad_samples);
  add_precision(*tool, o->precision);
  tool->add_option("--stats", o->stats, "Write counts and conflicts by slab to this JSON file; - for standard output")
      ->type_name("FILE.json")
      ->group("Run");
  add_run_options(*tool, o->run);
  add_notes(
      *tool,
      "Each normal comes from the plane through the nearest samples. Its sign comes from the scanner's position or an "
      "up direction where one is known; without, every surface turns its outside out. Signs travel from neighbour to "
      "neighbour, so that places seen at a grazing angle follow those seen well. The share of neighbours that still "
      "contradict each other is reported, with a warning past two percent. Memory goes with the cross-section of the "
      "cloud, and 64 MB; the rest is on disk.");
  add_examples(*tool,
               "  lamina normal scan.ply -o with_normals.ply\n"
               "  lamina normal scan.ply --k 8 --up 0,0,1 -o up.ply\n"
               "  lamina normal scan.ply --reorient --viewpoint 0,0,5 -o facing.ply\n"
               "  lamina normal scan.ply --check");
  tool->callback([o] { run_normal(*o); });
}

}  // namespace lamina::tools

// lamina attribtransfer: attributes from points to a mesh.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>

#include "common/console.h"
#include "common/help.h"
#include "common/inputs.h"
#include "common/text.h"
#include "lamina/edit.h"
#include "lamina/error.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct TransferOptions {
  std::string mesh, points, output;
  PointSettings reading;
  TransferSettings settings;
  RunOptions run;
};

void run_transfer(const TransferOptions& o) {
  if (o.mesh == "-" && o.points == "-")
    throw Error(ExitCode::usage, "MESH and POINTS both name standard input; give one of them a file");
  const RunContext context = make_context(o.run);
  TriangleMesh mesh = read_mesh_input(o.mesh, context);
  const auto points = open_point_input(o.points, o.reading, context);
  TransferSettings settings = o.settings;
  if (context.max_memory > 0) {
    const std::uint64_t bytes = 64 + 4 * points->info().attributes.size();
    settings.points_at_once = std::clamp<std::uint64_t>(context.max_memory / 4 / bytes, 1, settings.points_at_once);
  }
  const TransferReport report = transfer_attributes(*points, mesh, settings, context);
  write_mesh(mesh, o.output);
  if (report.unreachable > 0) {
    context.warn(fmt::format("{} of {} vertices have no point near enough; they keep the mesh's values, or get 0",
                             report.unreachable, mesh.positions.size()));
  }
  context.info(fmt::format("{} points gave {} vertices their attributes", count_text(report.points),
                           count_text(mesh.positions.size() - report.unreachable)));
}

}  // namespace

void add_attribtransfer(CLI::App& app) {
  auto* tool = app.add_subcommand("attribtransfer", "Give a mesh's vertices the attributes of the points around them");
  auto o = std::make_shared<TransferOptions>();
  tool->add_option_function<std::string>(
          "MESH", [o](const std::string& name) { o->mesh = pipe_name(name); },
          "Mesh to give them to; - for PLY on standard input")
      ->required()
      ->type_name("");
  tool->add_option_function<std::string>(
          "POINTS", [o](const std::string& name) { o->points = pipe_name(name); },
          "Points to take them from (streamed)")
      ->required()
      ->type_name("");
  tool->add_option_function<std::string>(
          "-o,--output", [o](const std::string& name) { o->output = pipe_name(name); },
          "Mesh to write; - for PLY on standard output")
      ->required()
      ->type_name("FILE")
      ->group("Output");
  const std::string group = "Transfer";
  tool->add_option("--attributes", o->settings.attributes, "Attributes to transfer, separated by commas [all]")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("NAME,...")
      ->group(group);
  const std::map<std::string, TransferMode> words{{"nearest", TransferMode::nearest},
                                                  {"weighted", TransferMode::weighted}};
  tool->add_option_function<std::string>(
          "--mode", [o, words](const std::string& word) { o->settings.mode = words.at(word); },
          "The nearest point's value, or the weighted mean of the points within --distance [nearest]")
      ->check(CLI::IsMember({"nearest", "weighted"}).description(""))
      ->type_name("nearest|weighted")
      ->group(group);
  tool->add_option("--distance", o->settings.distance,
                   "How far a point acts; 0: without limit (nearest), twice the points' own radii (weighted)")
      ->type_name("LENGTH")
      ->capture_default_str()
      ->group(group);
  add_point_options(*tool, o->reading);
  add_run_options(*tool, o->run);
  add_notes(
      *tool,
      "Points without a radius want --distance for the weighted mean. Memory: the mesh and four million points at a "
      "time.");
  add_examples(*tool,
               "  lamina attribtransfer mesh.ply scan.ply --attributes red,green,blue -o coloured.ply\n"
               "  lamina attribtransfer mesh.ply scan.ply --mode weighted --distance 0.2 -o smooth.ply");
  tool->callback([o] { run_transfer(*o); });
}

}  // namespace lamina::tools

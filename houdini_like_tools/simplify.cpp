// lamina simplify: fewer triangles for the same surface.
#include "lamina/simplify.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/console.h"
#include "common/help.h"
#include "common/inputs.h"
#include "common/options.h"
#include "common/outputs.h"
#include "common/text.h"
#include "lamina/error.h"
#include "tables.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct SimplifyOptions {
  std::string input;
  std::vector<std::string> outputs;
  SimplifyGoal goal;
  BadSamples bad = BadSamples::drop;
  RunOptions run;
};

SimplifyStats simplify_held(const SimplifyOptions& o, const SimplifySettings& settings, const RunContext& context) {
  if (o.outputs.size() > 1) {
    throw Error(ExitCode::usage, shown_name(o.input) +
                                     ": several --output are for a PLY that lamina has written; name "
                                     "one, and convert it");
  }
  TriangleMesh mesh = read_mesh_input(o.input, context, o.bad);
  if (mesh.triangles.empty())
    throw Error(ExitCode::unreadable,
                fmt::format("{}: has no faces: a point cloud, not a mesh; 'lamina surface' makes one of it",
                            shown_name(o.input)));
  // Doubles, quadrics and a queue of edges, whatever the file's format; with a bound also what triangles stand for.
  const std::size_t bytes_per_triangle = o.goal.error ? 650 : 450;
  if (context.max_memory > 0 && bytes_per_triangle * mesh.triangles.size() > context.max_memory) {
    throw Error(ExitCode::budget,
                fmt::format("{}: simplifying {} triangles needs about {} of memory, --max-memory "
                            "allows {}; give it more",
                            shown_name(o.input), count_text(mesh.triangles.size()),
                            bytes_text(bytes_per_triangle * mesh.triangles.size()), bytes_text(context.max_memory)));
  }
  const SimplifyStats stats = simplify_mesh(mesh, settings, context);
  write_mesh(mesh, o.outputs.front());
  return stats;
}

void run_simplify(const SimplifyOptions& o) {
  const SimplifySettings settings = simplify_settings(o.goal);
  std::for_each(o.outputs.begin(), o.outputs.end(), require_mesh_name);
  const RunContext context = make_context(o.run, o.outputs.front());
  const std::optional<SimplifyStats> of_file = simplify_file(o.input, o.outputs, settings, context);
  const SimplifyStats stats = of_file ? *of_file : simplify_held(o, settings, context);
  report_simplified(stats, shown_name(o.input), context);
}

}  // namespace

SimplifySettings simplify_settings(const SimplifyGoal& goal) {
  if (!goal.given())
    throw Error(ExitCode::usage, "one of --error, --triangles and --ratio, or --deviation, says how far to simplify");
  if (goal.error && !(*goal.error > 0 && std::isfinite(*goal.error)))
    throw Error(ExitCode::usage, fmt::format("--error {:g}: is a length above 0", *goal.error));
  if (goal.ratio && !(*goal.ratio > 0 && *goal.ratio <= 1))
    throw Error(ExitCode::usage, fmt::format("--ratio {:g}: is a share above 0 and up to 1", *goal.ratio));
  if (goal.triangles && *goal.triangles == 0)
    throw Error(ExitCode::usage, "--triangles 0: at least one triangle has to stay");
  if (goal.deviation && !(*goal.deviation > 0 && *goal.deviation <= 1))
    throw Error(ExitCode::usage, fmt::format("--deviation {:g}: is above 0 and up to 1", *goal.deviation));
  return {goal.triangles.value_or(0), goal.error.value_or(0), goal.ratio.value_or(0), goal.deviation.value_or(0)};
}

void report_simplified(const SimplifyStats& stats, const std::string& name, const RunContext& context) {
  if (!stats.reached) {
    context.warn(
        fmt::format("{}: more triangles stay than were wanted: no other edge can go without a fold or a change "
                    "of topology",
                    name));
  }
  context.info(
      fmt::format("{} triangles of {}", count_text(stats.triangles_after), count_text(stats.triangles_before)));
}

void add_simplify_goal(CLI::App& tool, SimplifyGoal& goal, const std::string& group) {
  auto* error = tool.add_option("--error", goal.error,
                                "How far the mesh may get from what it was, and that from it, in its units");
  error->type_name("LENGTH")->group(group);
  auto* triangles = tool.add_option("--triangles", goal.triangles, "How many triangles stay, at most those there are");
  triangles->type_name("N")->check(refuse_below_zero)->excludes(error)->group(group);
  tool.add_option("--ratio", goal.ratio, "Which share of the triangles stays, above 0 and up to 1")
      ->type_name("K")
      ->excludes(triangles)
      ->excludes(error)
      ->group(group);
}

void add_simplify(CLI::App& app) {
  auto* tool = app.add_subcommand("simplify", "Give a mesh fewer triangles where they count least");
  auto o = std::make_shared<SimplifyOptions>();
  tool->add_option_function<std::string>(
          "INPUT", [o](const std::string& name) { o->input = pipe_name(name); },
          "Mesh, manifold: .ply .obj .off .stl .glb, each also as .gz; - for PLY on standard input")
      ->required()
      ->type_name("");
  tool->add_option_function<std::vector<std::string>>(
          "-o,--output",
          [o](const std::vector<std::string>& names) {
            for (const std::string& name : names) o->outputs.push_back(pipe_name(name));
          },
          "Mesh: .ply .obj .off .stl .glb; - for PLY on standard output. Several -o write it in several formats, where "
          "the input is a PLY that lamina has written")
      ->required()
      ->type_name("FILE")
      ->allow_extra_args(false)
      ->group("Output");
  add_simplify_goal(*tool, o->goal, "Goal");
  auto* deviation = tool->add_option("--deviation", o->goal.deviation,
                                     "Triangles go where the surface is flat: within K lengths of an edge there, root "
                                     "mean square, up to 1; 0.01 to 0.05 are no loss for most meshes. Boundaries stay");
  deviation->type_name("K")->group("Goal");
  for (const char* other : {"--error", "--triangles", "--ratio"}) deviation->excludes(tool->get_option(other));
  add_bad_samples(*tool, o->bad, "Vertices");
  add_run_options(*tool, o->run);
  add_notes(
      *tool,
      "Edges are contracted in the order of their quadric error, each to the point of least error; attributes are "
      "interpolated. The mesh stays manifold with the same parts, handles and boundary loops. With --error every "
      "contraction is proved to keep the largest distance, measured from either mesh to the other, within it. A binary "
      "PLY that lamina has written is read and written piece by piece: memory stays below 1 GB, whatever its size. "
      "Other files are held.");
  add_examples(*tool,
               "  lamina simplify mesh.ply --ratio 0.5 -o fewer.ply\n"
               "  lamina simplify mesh.ply --error 0.001 -o within.ply");
  tool->callback([o] { run_simplify(*o); });
}

}  // namespace lamina::tools

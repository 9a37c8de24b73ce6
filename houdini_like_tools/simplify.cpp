// lamina simplify: fewer triangles for the same surface.
#include "lamina/simplify.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>

#include "common/console.h"
#include "common/help.h"
#include "common/inputs.h"
#include "common/outputs.h"
#include "common/text.h"
#include "lamina/error.h"
#include "tables.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct SimplifyOptions {
  std::string input, output;
  SimplifyGoal goal;
  BadSamples bad = BadSamples::drop;
  RunOptions run;
};

void require_goal(const SimplifyGoal& goal) {
  if (!goal.triangles && !goal.ratio && !goal.error)
    throw Error(ExitCode::usage, "one of --error, --triangles and --ratio says how far to simplify");
}

void run_simplify(const SimplifyOptions& o) {
  require_goal(o.goal);
  require_mesh_name(o.output);
  const RunContext context = make_context(o.run, o.output);
  TriangleMesh mesh = read_mesh_input(o.input, context, o.bad);
  if (mesh.triangles.empty())
    throw Error(ExitCode::unreadable, fmt::format("{}: has no faces: a point cloud, not a mesh", shown_name(o.input)));
  // Doubles, quadrics and a queue of edges, whatever the file's format; with a bound also what triangles stand for.
  const std::size_t bytes_per_triangle = o.goal.error ? 650 : 450;
  if (context.max_memory > 0 && bytes_per_triangle * mesh.triangles.size() > context.max_memory) {
    throw Error(ExitCode::budget,
                fmt::format("{}: simplifying {} triangles needs about {} of memory, --max-memory "
                            "allows {}; give it more",
                            shown_name(o.input), count_text(mesh.triangles.size()),
                            bytes_text(bytes_per_triangle * mesh.triangles.size()), bytes_text(context.max_memory)));
  }
  const SimplifyStats stats = simplify_mesh(mesh, simplify_settings(o.goal, mesh.triangles.size()), context);
  if (!stats.reached) {
    context.warn(
        fmt::format("{}: more triangles stay than were wanted: no other edge can go without a fold or a change "
                    "of topology",
                    shown_name(o.input)));
  }
  write_mesh(mesh, pipe_name(o.output));
  context.info(
      fmt::format("{} triangles of {}", count_text(stats.triangles_after), count_text(stats.triangles_before)));
}

}  // namespace

SimplifySettings simplify_settings(const SimplifyGoal& goal, std::size_t there) {
  require_goal(goal);
  if (goal.error) {
    if (!(*goal.error > 0 && std::isfinite(*goal.error)))
      throw Error(ExitCode::usage, fmt::format("--error {:g}: is a length above 0", *goal.error));
    return {0, *goal.error};
  }
  if (goal.triangles) return {*goal.triangles, 0};
  if (!(*goal.ratio > 0 && *goal.ratio <= 1))
    throw Error(ExitCode::usage, fmt::format("--ratio {:g}: is a share above 0 and up to 1", *goal.ratio));
  return {static_cast<std::uint64_t>(std::max(1.0, std::floor(*goal.ratio * static_cast<double>(there)))), 0};
}

void add_simplify_goal(CLI::App& tool, SimplifyGoal& goal) {
  auto* error = tool.add_option("--error", goal.error,
                                "How far the mesh may get from what it was, and that from it, in its units");
  error->type_name("LENGTH");
  auto* triangles = tool.add_option("--triangles", goal.triangles, "How many triangles stay, at most those there are");
  triangles->type_name("N")->excludes(error);
  tool.add_option("--ratio", goal.ratio, "Which share of the triangles stays, above 0 and up to 1")
      ->type_name("K")
      ->excludes(triangles)
      ->excludes(error);
}

void add_simplify(CLI::App& app) {
  auto* tool = app.add_subcommand("simplify", "Give a mesh fewer triangles where they count least");
  auto o = std::make_shared<SimplifyOptions>();
  add_files(*tool, o->input, "Mesh, manifold: .ply .obj .off .stl, each also as .gz", o->output,
            "Mesh: .ply .obj .off .stl; - for PLY on standard output");
  add_simplify_goal(*tool, o->goal);
  add_bad_samples(*tool, o->bad, "Vertices");
  add_run_options(*tool, o->run);
  add_notes(
      *tool,
      "Edges are contracted in the order of their quadric error, each to the point of least error; attributes are "
      "interpolated. The mesh stays manifold with the same parts, handles and boundary loops. With --error every "
      "contraction is proved to keep the largest distance, measured from either mesh to the other, within it. The mesh "
      "is held in memory.");
  add_examples(*tool,
               "  lamina simplify mesh.ply --ratio 0.5 -o fewer.ply\n"
               "  lamina simplify mesh.ply --error 0.001 -o within.ply");
  tool->callback([o] { run_simplify(*o); });
}

}  // namespace lamina::tools

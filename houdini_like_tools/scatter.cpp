// lamina scatter: points with normals on a mesh or a procedural shape.
#include <fmt/format.h>

#include <memory>

#include "lamina/error.h"
#include "lamina/scatter.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct ScatterOptions {
  std::string mesh, shape, output;
  bool colour = false;
  ScatterSettings settings;
  RunContext run;
  bool quiet = false;
};

void run_scatter(const ScatterOptions& o) {
  TriangleMesh mesh;
  if (o.shape.empty()) mesh = read_mesh(o.mesh);
  const auto surface = o.shape.empty() ? mesh_surface(mesh) : shape_surface(o.shape, o.colour);
  const ScatterReport report = scatter(*surface, o.settings, o.output, o.run);
  if (!o.quiet)
    fmt::print(stderr, "{} samples on an area of {:.6g}, spacing {:.6g}\n", o.settings.count, report.area,
               report.spacing);
}

}  // namespace

void add_scatter(CLI::App& app) {
  auto* tool =
      app.add_subcommand("scatter", "Scatter points with normals (and colours) over a surface, uniformly by area");
  auto o = std::make_shared<ScatterOptions>();
  auto* mesh = tool->add_option("MESH", o->mesh, "mesh to sample: .ply .obj .off .stl, each also as .gz");
  auto* shape = tool->add_option("--shape", o->shape, "a procedural shape instead of a mesh")
                    ->check(CLI::IsMember(shape_names()));
  mesh->excludes(shape);
  tool->add_flag("--colour,--color", o->colour, "give the shape an analytic pattern of colours (a mesh brings its own)")
      ->needs(shape);
  tool->add_option("-o,--output", o->output, "points to write: binary little-endian PLY, - for standard output")
      ->required();
  tool->add_option("--count", o->settings.count, "number of samples")->capture_default_str();
  tool->add_option("--seed", o->settings.seed, "another seed, another cloud")->capture_default_str();
  tool->add_option("--noise", o->settings.noise,
                   "k: move every coordinate by up to k/2 local spacings either way, uniformly")
      ->capture_default_str();
  tool->add_option(
          "--density-ratio,--varying", o->settings.density_ratio,
          "D: let the density fall D-fold, evenly by octaves, along the longest axis (spacing grows by sqrt(D))")
      ->capture_default_str();
  tool->add_flag("--double", o->settings.double_positions, "write double positions");
  tool->add_option("--threads", o->run.threads, "0: all")->capture_default_str();
  tool->add_flag("--quiet", o->quiet, "no summary");
  tool->callback([o] {
    if (o->mesh.empty() && o->shape.empty()) throw CLI::RequiredError("MESH or --shape");
    run_scatter(*o);
  });
}

}  // namespace lamina::tools

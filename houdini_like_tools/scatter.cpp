// lamina scatter: points with normals on a mesh or a procedural shape.
#include <fmt/format.h>

#include <memory>

#include "common/help.h"
#include "common/inputs.h"
#include "common/options.h"
#include "lamina/error.h"
#include "lamina/scatter.h"
#include "tool.h"

namespace lamina::tools {
namespace {

constexpr const char* kAmphora = "amphora";

std::vector<std::string> known_shapes() {
  auto names = shape_names();
  names.emplace_back(kAmphora);
  return names;
}

struct ScatterOptions {
  std::string mesh, shape, output;
  bool colour = false;
  ScatterSettings settings;
  ScanSettings scan;
  RunContext run;
  bool quiet = false;
};

void scatter_over(const ScatterOptions& o, const Surface& surface) {
  const ScatterReport report = scatter(surface, o.settings, o.output, o.run);
  if (!o.quiet)
    fmt::print(stderr, "{} samples on an area of {:.6g}, spacing {:.6g}\n", o.settings.count, report.area,
               report.spacing);
}

void scan_mesh(const ScatterOptions& o, const TriangleMesh& mesh) {
  ScanSettings settings = o.scan;
  settings.count = o.settings.count;
  settings.seed = o.settings.seed;
  const ScanReport report = scan(mesh, settings, o.output, o.run);
  if (!o.quiet)
    fmt::print(stderr, "{} samples from {} views, grid spacing {:.6g}\n", report.samples, settings.views,
               report.spacing);
}

void run_scatter(const ScatterOptions& o, bool scanning) {
  const bool amphora = o.shape == kAmphora;
  if (!o.shape.empty() && !amphora) {
    if (scanning) throw Error(ExitCode::usage, fmt::format("--scan wants a mesh or --shape {}", kAmphora));
    scatter_over(o, *shape_surface(o.shape, o.colour));
    return;
  }
  const TriangleMesh mesh = amphora ? amphora_mesh() : read_mesh_input(o.mesh, o.run);
  if (scanning)
    scan_mesh(o, mesh);
  else
    scatter_over(o, *mesh_surface(mesh));
}

}  // namespace

void add_scatter(CLI::App& app) {
  auto* tool = app.add_subcommand(
      "scatter", "Scatter points with normals (and colours) over a mesh or a shape, uniformly by area");
  auto o = std::make_shared<ScatterOptions>();
  auto* mesh =
      tool->add_option("MESH", o->mesh, "Mesh to sample: .ply .obj .off .stl .glb, each also as .gz")->type_name("");
  auto* shape = tool->add_option("--shape", o->shape, "A procedural shape instead of a mesh")
                    ->check(CLI::IsMember(known_shapes()));
  mesh->excludes(shape);
  tool->add_flag("--colour,--color", o->colour,
                 "Give the shape an analytic pattern of colours; a mesh and the amphora bring their own")
      ->needs(shape);
  tool->add_option("-o,--output", o->output, "Points to write: binary little-endian PLY, - for standard output")
      ->required()
      ->type_name("FILE");
  tool->add_option("--count", o->settings.count, "Number of samples")
      ->type_name("N")
      ->check(refuse_below_zero)
      ->capture_default_str();
  tool->add_option("--seed", o->settings.seed, "Another seed, another cloud")->type_name("N")->capture_default_str();
  tool->add_option("--noise", o->settings.noise,
                   "Move every coordinate by up to K/2 local spacings either way, uniformly")
      ->type_name("K")
      ->capture_default_str();
  tool->add_option("--density-ratio,--varying", o->settings.density_ratio,
                   "Let the density fall D-fold, evenly by octaves, along the longest axis (the spacing grows by the "
                   "root of D); up "
                   "to 1000000")
      ->type_name("D")
      ->capture_default_str();
  tool->add_flag("--double", o->settings.double_positions, "Write double positions");
  auto* scanning = tool->add_option(
      "--scan", o->scan.views,
      "Instead of scattering, scan the mesh (or --shape amphora) with a make-believe range camera from so many sides; "
      "adds confidence");
  scanning->type_name("VIEWS");
  tool->add_option("--scan-noise", o->scan.noise, "Range noise of --scan: a standard deviation in grid spacings")
      ->type_name("K")
      ->capture_default_str()
      ->needs(scanning);
  tool->add_option("--threads", o->run.threads, "Number of threads; 0 is every core")
      ->type_name("N")
      ->capture_default_str()
      ->group("Run");
  tool->add_flag("--quiet", o->quiet, "No summary")->group("Run");
  add_notes(*tool, "The mesh is held in memory, the points are not.");
  add_examples(*tool,
               "  lamina scatter mesh.ply --count 5000 -o points.ply\n"
               "  lamina scatter --shape torus --count 5000 --noise 1 -o noisy.ply");
  tool->callback([o, scanning] {
    if (o->mesh.empty() && o->shape.empty()) throw CLI::RequiredError("MESH or --shape");
    run_scatter(*o, scanning->count() > 0);
  });
}

}  // namespace lamina::tools

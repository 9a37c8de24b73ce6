// lamina render: a picture of a mesh or a point cloud.
#include "lamina/render.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "console.h"
#include "inputs.h"
#include "lamina/error.h"
#include "lamina/info.h"
#include "lamina/points.h"
#include "numbers.h"
#include "text.h"
#include "tool.h"

namespace lamina::tools {
namespace {

constexpr std::size_t kBatch = std::size_t{1} << 20;  // points held at a time

struct RenderOptions {
  std::string input, output;
  RenderSettings settings;
  RunOptions run;
};

/// Every batch of the file, with progress.
template <class Take>
void for_batches(PointSource& source, std::string_view stage, const RunContext& context, const Take& take) {
  SampleBatch batch;
  const std::uint64_t total = source.info().count;
  for (std::uint64_t first = 0; first < total; first += batch.size()) {
    if (context.cancelled()) throw Error(ExitCode::internal, "cancelled");
    source.read(first, kBatch, batch);
    take(batch);
    if (context.progress) context.progress({stage, first + batch.size(), total, 0, 0});
  }
}

void draw_points(Renderer& renderer, const RenderOptions& o, const RunContext& context) {
  const auto source = open_points(o.input, o.run.tmp_dir);
  if (source->info().count == 0) throw Error(ExitCode::empty, fmt::format("{}: no points to draw", o.input));
  for_batches(*source, "frame", context, [&](const SampleBatch& batch) { renderer.frame(batch); });
  for_batches(*source, "draw", context,
              [&](const SampleBatch& batch) { renderer.draw(batch, source->info().attributes); });
  context.info(fmt::format("drew {} points", count_text(source->info().count)));
}

/// A mesh file's vertices, where it has nothing but vertices.
SampleBatch as_points(TriangleMesh& mesh) {
  SampleBatch points;
  for (const auto& p : mesh.positions) {
    points.x.push_back(p[0]);
    points.y.push_back(p[1]);
    points.z.push_back(p[2]);
  }
  for (const auto& n : mesh.normals) {
    points.nx.push_back(n[0]);
    points.ny.push_back(n[1]);
    points.nz.push_back(n[2]);
  }
  points.attributes = std::move(mesh.attributes);
  return points;
}

void draw_mesh(Renderer& renderer, const RenderOptions& o, const RunContext& context) {
  TriangleMesh mesh = read_mesh(o.input);
  if (mesh.positions.empty()) throw Error(ExitCode::empty, fmt::format("{}: no vertices to draw", o.input));
  renderer.frame(mesh);
  if (mesh.triangles.empty()) {
    const SampleBatch points = as_points(mesh);
    renderer.draw(points, mesh.layout);
    context.info(fmt::format("drew {} vertices; there are no faces", count_text(points.size())));
    return;
  }
  renderer.draw(mesh);
  context.info(fmt::format("drew {} triangles", count_text(mesh.triangles.size())));
  if (o.settings.mark_boundary) context.info(fmt::format("marked {} boundary edges", renderer.boundary_edges()));
}

void run_render(const RenderOptions& o) {
  const RunContext context = make_context(o.run);
  Renderer renderer(o.settings, context);
  if (content_of(o.input, o.run.tmp_dir) == FileContent::points) {
    draw_points(renderer, o, context);
  } else {
    draw_mesh(renderer, o, context);
  }
  if (renderer.blank())
    context.warn(o.input + ": nothing of it is in the picture; is the zoom's place inside the model?");
  write_png(renderer.finish(), o.output);
}

void add_camera_options(CLI::App& tool, RenderSettings& s) {
  add_numbers(tool, "--view", ',', 2, "AZIMUTH,ELEVATION",
              "Where the camera stands, degrees around and above; 0,0 is the front [30,20]",
              [&s](const auto& v) {
                s.azimuth = v[0];
                s.elevation = v[1];
              })
      ->group("Camera");
  tool.add_option("--views", s.views, "Views from around the up axis, side by side")
      ->check(CLI::Range(1, 16))
      ->type_name("N")
      ->capture_default_str()
      ->group("Camera");
  tool.add_option_function<std::string>(
          "--up", [&s](const std::string& axis) { s.up = axis[0] - 'x'; }, "Axis that points up [y]")
      ->check(CLI::IsMember({"x", "y", "z"}).description(""))
      ->type_name("x|y|z")
      ->group("Camera");
  add_numbers(tool, "--zoom", ',', 4, "X,Y,Z,RADIUS",
              "Look at a place: this ball fills the picture, what hides it is cut away",
              [&s](const auto& v) {
                if (!(v[3] > 0)) throw CLI::ValidationError("--zoom", "the radius must be positive");
                s.zoom = RenderSettings::Zoom{{v[0], v[1], v[2]}, v[3]};
              })
      ->group("Camera");
}

void add_look_options(CLI::App& tool, RenderSettings& s) {
  const std::map<std::string, ColourMode> modes{
      {"auto", ColourMode::automatic}, {"none", ColourMode::none}, {"normals", ColourMode::normals}};
  tool.add_option_function<std::string>(
          "--colour,--color", [&s, modes](const std::string& name) { s.colour = modes.at(name); },
          "The file's colours where it has them, one colour, or normals as colours [auto]")
      ->check(CLI::IsMember({"auto", "none", "normals"}).description(""))
      ->type_name("auto|none|normals")
      ->group("Look");
  tool.add_flag("--flat", s.flat, "One shade per triangle instead of interpolated normals")->group("Look");
  tool.add_flag("--wire", s.wire, "Lines along the triangles' edges")->group("Look");
  tool.add_flag("--mark-boundary", s.mark_boundary, "Edges of only one triangle in red, over everything")
      ->group("Look");
  tool.add_option("--point-radius", s.point_radius,
                  "Radius of points' discs in input units; 0: half their own radius, or from density")
      ->check(CLI::NonNegativeNumber.description(""))
      ->type_name("LENGTH")
      ->capture_default_str()
      ->group("Look");
}

}  // namespace

void add_render(CLI::App& app) {
  CLI::App* tool = app.add_subcommand("render", "Draw a picture of a mesh or a point cloud");
  auto o = std::make_shared<RenderOptions>();
  tool->add_option("INPUT", o->input,
                   "Mesh (.ply .obj .off .stl, each also as .gz) or points (.ply, - for standard input)")
      ->required()
      ->type_name("");
  tool->add_option("-o,--output", o->output, "Picture to write: PNG, - for standard output")
      ->required()
      ->type_name("FILE")
      ->group("Picture");
  add_numbers(*tool, "--size", 'x', 2, "WxH", "Pixels of the whole picture [1024x1024]",
              [o](const std::vector<double>& v) {
                for (const double side : v) {
                  if (side != std::floor(side) || side < 1 || side > 16384) {
                    throw CLI::ValidationError("--size", "sides are whole numbers, 1 to 16384");
                  }
                }
                o->settings.width = static_cast<int>(v[0]);
                o->settings.height = static_cast<int>(v[1]);
              })
      ->group("Picture");
  tool->add_option("--supersample", o->settings.supersample, "Samples per pixel in each direction")
      ->check(CLI::Range(1, 8))
      ->type_name("N")
      ->capture_default_str()
      ->group("Picture");
  add_camera_options(*tool, o->settings);
  add_look_options(*tool, o->settings);
  add_run_options(*tool, o->run);
  add_examples(*tool,
               "  lamina render mesh.ply --size 200x200 -o mesh.png\n"
               "  lamina render scan.ply --size 200x200 --up z -o scan.png");
  tool->callback([o] { run_render(*o); });
}

}  // namespace lamina::tools

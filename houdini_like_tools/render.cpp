// lamina render: a picture of a mesh, a point cloud, a level set or a fog.
#include "lamina/render.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <memory>

#include "common/console.h"
#include "common/help.h"
#include "common/model.h"
#include "common/options.h"
#include "common/outputs.h"
#include "tables.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct RenderOptions {
  std::string input, output;
  PictureOptions picture;
  RunOptions run;
};

/// OUT.png, or OUT.0001.png ... where there are several.
std::string frame_name(const std::string& output, int frame, int frames) {
  if (frames == 1) return output;
  std::filesystem::path name(output);
  const std::string ending = name.extension().string();
  return name.replace_extension(fmt::format("{:04d}{}", frame + 1, ending.empty() ? ".png" : ending)).string();
}

void run_render(const RenderOptions& o) {
  const RunContext context = make_context(o.run);
  const RenderSettings& s = o.picture.settings;
  ModelOptions options = o.picture.model;
  options.as_triangles = s.flat || s.wire || s.mark_boundary;
  Renderer renderer(s, context);
  const std::unique_ptr<Model> model = open_model(o.input, options, context);
  model->frame(renderer);
  bool blank = true;
  for (int frame = 0; frame < s.frames; ++frame) {
    if (frame > 0) renderer.turn(frame);
    model->draw(renderer);
    blank = blank && renderer.blank();
    write_png(renderer.finish(), frame_name(o.output, frame, s.frames));
    if (s.frames > 1 && context.progress)
      context.progress({"turn", static_cast<std::uint64_t>(frame) + 1, static_cast<std::uint64_t>(s.frames), 0, 0});
  }
  if (blank) context.warn(o.input + ": nothing of it is in the picture; is the zoom's place inside the model?");
  context.info("drew " + model->what());
  if (s.mark_boundary) context.info(fmt::format("marked {} boundary edges", renderer.boundary_edges()));
}

void add_camera_options(CLI::App& tool, RenderSettings& s) {
  add_numbers(tool, "--view", {"AZIMUTH,ELEVATION", 2},
              "Where the camera stands, in degrees around and above; 0,0 is the front [30,20]",
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
  tool.add_option("--frames", s.frames, "A turntable: so many pictures of one turn, OUT.0001.png ...")
      ->check(CLI::Range(1, 9999))
      ->type_name("N")
      ->capture_default_str()
      ->group("Camera");
  tool.add_option_function<std::string>(
          "--up", [&s](const std::string& axis) { s.up = axis[0] - 'x'; }, "Axis that points up [y]")
      ->check(CLI::IsMember({"x", "y", "z"}).description(""))
      ->type_name("x|y|z")
      ->group("Camera");
  add_numbers(tool, "--zoom", {"X,Y,Z,RADIUS", 4},
              "Look at a place: this ball fills the picture, and what hides it is cut away [everything]",
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
  tool.add_flag("--flat", s.flat, "One shade per triangle instead of interpolated normals (which end at sharp edges)")
      ->group("Look");
  tool.add_flag("--wireframe,--wire", s.wire, "Lines along the triangles' edges")->group("Look");
  tool.add_flag("--mark-boundary", s.mark_boundary, "Edges of only one triangle in red, over everything")
      ->group("Look");
  tool.add_option("--point-radius", s.point_radius,
                  "Radius of points' discs; 0: half their own radius, or from the density")
      ->check(CLI::NonNegativeNumber.description(""))
      ->type_name("LENGTH")
      ->capture_default_str()
      ->group("Look");
}

void add_paint_options(CLI::App& tool, PaintOptions& paint) {
  tool.add_option(
          "--paint", paint.what,
          "Values of a mesh or of points as colours, blue to red: the distance from --reference, radius, or any other "
          "attribute by name; the scale is printed")
      ->type_name("distance|NAME")
      ->group("Look");
  tool.add_option("--reference", paint.reference, "The mesh or .vdb level set from which --paint distance measures")
      ->type_name("FILE")
      ->group("Look");
  add_numbers(tool, "--paint-range", {"LOW,HIGH", 2},
              "Values of the first and the last colour [0, or the least, and what 99 % do not exceed]",
              [&paint](const auto& v) {
                if (!(v[1] > v[0])) throw CLI::ValidationError("--paint-range", "HIGH must be above LOW");
                paint.range = PaintRange{v[0], v[1]};
              })
      ->group("Look");
}

void check_together(const RenderOptions& o) {
  require_together(o.picture);
  if (o.picture.settings.frames > 1 && o.output == "-")
    throw CLI::ValidationError("--frames", "several pictures do not go to standard output; name a file");
  require_picture_name(o.output);
}

}  // namespace

void require_together(const PictureOptions& o) {
  const PaintOptions& paint = o.model.paint;
  if (paint.what == "distance" && paint.reference.empty())
    throw CLI::ValidationError("--paint", "distance wants --reference, the mesh to measure from");
  if (paint.what != "distance" && !paint.reference.empty())
    throw CLI::ValidationError("--reference", "goes with --paint distance");
  if (paint.what.empty() && paint.range) throw CLI::ValidationError("--paint-range", "goes with --paint");
  if (!paint.what.empty() && o.settings.colour != ColourMode::automatic)
    throw CLI::ValidationError("--paint", "and --colour exclude each other");
}

void add_picture_options(CLI::App& tool, PictureOptions& o) {
  add_numbers(tool, "--size", {"WxH", 2, 'x'}, "Pixels of the whole picture, sides of 1 to 16384 [1024x1024]",
              [&o](const std::vector<double>& v) {
                for (const double side : v) {
                  if (side != std::floor(side) || side < 1 || side > 16384) {
                    throw CLI::ValidationError("--size", "sides are whole numbers, 1 to 16384");
                  }
                }
                o.settings.width = static_cast<int>(v[0]);
                o.settings.height = static_cast<int>(v[1]);
              })
      ->group("Picture");
  tool.add_option("--supersample", o.settings.supersample, "Samples per pixel in each direction")
      ->check(CLI::Range(1, 8))
      ->type_name("N")
      ->capture_default_str()
      ->group("Picture");
  add_camera_options(tool, o.settings);
  add_look_options(tool, o.settings);
  add_paint_options(tool, o.model.paint);
  tool.add_option("--grid", o.model.grid,
                  "Name of the grid to draw, of a .vdb [its level set, else its fog, else its points]")
      ->type_name("NAME")
      ->group("Look");
}

void add_render(CLI::App& app) {
  CLI::App* tool = app.add_subcommand("render", "Draw a picture of a mesh, a point cloud or a volume");
  auto o = std::make_shared<RenderOptions>();
  tool->add_option("INPUT", o->input,
                   "Mesh (.ply .obj .off .stl .glb, each also as .gz), points (- for standard input), or volume (.vdb: "
                   "level set, "
                   "fog or points)")
      ->required()
      ->type_name("");
  tool->add_option("-o,--output", o->output, "Picture to write: PNG, - for standard output")
      ->required()
      ->type_name("FILE")
      ->group("Picture");
  add_picture_options(*tool, o->picture);
  add_run_options(*tool, o->run);
  add_notes(
      *tool,
      "Needs no screen. Back faces are tinted blue. Point files are drawn in batches and may be larger than memory; "
      "meshes and volumes are held. Level sets are drawn by OpenVDB's ray intersector, smooth, in the colours of "
      "their grid Cd, open ones without their band's rim; with --flat, --wireframe, --mark-boundary or --paint they "
      "are meshed first. OpenVDB points are drawn as points, fogs by the light that their density lets through.");
  add_examples(*tool,
               "  lamina render mesh.ply --size 200x200 -o mesh.png\n"
               "  lamina render scan.ply --size 200x200 --up z -o scan.png\n"
               "  lamina render mesh.vdb --size 200x200 -o mesh_volume.png\n"
               "  lamina render mesh.ply --size 200x200 --paint distance --reference other.obj -o distance.png");
  tool->callback([o] {
    check_together(*o);
    run_render(*o);
  });
}

}  // namespace lamina::tools

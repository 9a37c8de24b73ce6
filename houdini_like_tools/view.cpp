// lamina view: a page to look at a mesh, points or tiles in a browser.
#include "lamina/view.h"

#include <fmt/format.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <system_error>

#include "common/console.h"
#include "common/help.h"
#include "common/inputs.h"
#include "common/text.h"
#include "lamina/error.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct ViewOptions {
  std::string input, output;
  int port = 0;
  bool serve = false;
  PointSettings reading;
  ViewSettings settings;
  RunOptions run;
};

bool is_folder(const std::string& path) {
  std::error_code failed;
  return std::filesystem::is_directory(path, failed);
}

std::string title_of(const std::string& input) {
  if (input == "-") return shown_name(input);
  const std::filesystem::path path(input);
  return (path.has_filename() ? path : path.parent_path()).filename().string();
}

void serve(const ViewOptions& o, const RunContext& context) {
  const auto listening = [](const std::string& address) {
    fmt::print("{}\n", address);
    std::fflush(stdout);
  };
  context.info("serving on this machine alone; Ctrl-C ends it");
  serve_tiles(o.input, o.settings, o.port, listening, context);
}

void view_mesh(const ViewOptions& o, const RunContext& context) {
  const ViewStats stats = write_mesh_page(read_mesh_input(o.input, context, o.settings.bad), o.settings, o.output);
  context.info(fmt::format("{}: {} vertices, {} triangles, {} boundary {}", o.output, count_text(stats.vertices),
                           count_text(stats.triangles), count_text(stats.boundary_loops),
                           stats.boundary_loops == 1 ? "loop" : "loops"));
}

void view_points(const ViewOptions& o, const RunContext& context) {
  const auto source = open_point_input(o.input, o.reading, context);
  const ViewStats stats = write_points_page(*source, o.settings, o.output, context);
  context.info(fmt::format("{}: {} points{}", o.output, count_text(stats.points),
                           o.settings.points > 0 && o.settings.points < stats.points_there
                               ? fmt::format(", an even subset of {}", count_text(stats.points_there))
                               : ""));
}

void refuse_points_option(const ViewOptions& o) {
  if (o.settings.points == 0) return;
  throw Error(ExitCode::usage, fmt::format("{}: --points thins out points, which this is not; 'lamina simplify' leaves "
                                           "a mesh fewer triangles",
                                           shown_name(o.input)));
}

void run_view(ViewOptions o) {
  const RunContext context = make_context(o.run, o.output);
  if (o.serve == !o.output.empty())
    throw Error(ExitCode::usage, o.serve ? "--serve writes no page: it excludes -o" : "-o names the page to write");
  o.settings.bundle = find_viewer();
  o.settings.title = title_of(o.input);
  if (is_folder(o.input)) {
    refuse_points_option(o);
    if (o.serve) return serve(o, context);
    const ViewStats stats = write_tiles_page(o.input, o.settings, o.output);
    context.info(fmt::format("{}: {} files of tiles, {}", o.output, count_text(stats.tiles), bytes_text(stats.bytes)));
    return;
  }
  if (o.serve)
    throw Error(ExitCode::usage, shown_name(o.input) + ": --serve is for a folder of tiles; write a page with -o");
  const FileContent content = content_of(o.input, o.run.tmp_dir);
  if (content != FileContent::points) refuse_points_option(o);
  switch (content) {
    case FileContent::points:
      return view_points(o, context);
    case FileContent::mesh:
      return view_mesh(o, context);
    case FileContent::volume:
      throw Error(ExitCode::usage, fmt::format("{}: a volume; make a mesh of it with 'lamina convert {} -o mesh.ply'",
                                               o.input, o.input));
  }
}

}  // namespace

void add_view(CLI::App& app) {
  auto* tool = app.add_subcommand("view", "Make a page to look at a mesh, points or tiles in a browser");
  auto o = std::make_shared<ViewOptions>();
  tool->add_option_function<std::string>(
          "INPUT", [o](const std::string& name) { o->input = pipe_name(name); },
          "Mesh, points (- for PLY on standard input), or a folder with a tileset.json")
      ->required()
      ->type_name("");
  auto* output = tool->add_option("-o,--output", o->output, "Page to write: .html, which holds everything");
  output->type_name("FILE")->group("Output");
  auto* serve = tool->add_option_function<int>(
      "--serve",
      [o](int port) {
        o->serve = true;
        o->port = port;
      },
      "Serve a folder of tiles on this machine until Ctrl-C; 0: at a free port");
  serve->type_name("PORT")->check(CLI::Range(0, 65535))->excludes(output)->group("Output");
  const std::map<std::string, ViewUp> axes{
      {"auto", ViewUp::automatic}, {"x", ViewUp::x}, {"y", ViewUp::y}, {"z", ViewUp::z}};
  tool->add_option_function<std::string>(
          "--up", [o, axes](const std::string& axis) { o->settings.up = axes.at(axis); },
          "Axis that points up; auto: z for tiles and surveys, else y [auto]")
      ->check(CLI::IsMember({"auto", "x", "y", "z"}).description(""))
      ->type_name("auto|x|y|z")
      ->group("Output");
  tool->add_option("--points", o->settings.points, "At most so many points, spread evenly over the cloud; 0: all")
      ->type_name("N")
      ->capture_default_str()
      ->group("Output");
  add_point_options(*tool, o->reading);
  add_bad_samples(*tool, o->settings.bad, "Points and vertices");
  add_run_options(*tool, o->run);
  add_notes(*tool,
            "The page opens in any browser with WebGL 2, without a network. It shows colours, normals, any attribute "
            "with a scale, edges and boundary loops, cuts by a plane, measures distances and saves pictures; ? lists "
            "its keys. It holds up to 400 MB of data: larger meshes want tiles, larger clouds --points.");
  add_examples(*tool,
               "  lamina view mesh.ply -o mesh.html\n"
               "  lamina view scan.ply --points 1000000 -o scan.html");
  tool->callback([o] { run_view(*o); });
}

}  // namespace lamina::tools

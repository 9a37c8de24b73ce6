// lamina tiles: a mesh as a tree of levels of detail.
#include "lamina/tiles.h"

#include <fmt/format.h>

#include <memory>
#include <string>

#include "common/console.h"
#include "common/help.h"
#include "common/inputs.h"
#include "common/outputs.h"
#include "lamina/error.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct TilesOptions {
  std::string input;
  TileSettings tiles;
  bool plain = false;
  RunOptions run;
};

void run_tiles(const TilesOptions& o) {
  const RunContext context = make_context(o.run, o.tiles.folder);
  TileSettings settings = o.tiles;
  settings.compress = !o.plain;
  const std::string input = pipe_name(o.input);
  settings.crs = crs_of_mesh(input);
  if (const auto stats = write_tiles_of_file(input, settings, context)) {
    context.info(tiles_text(*stats));
    return;
  }
  const TriangleMesh mesh = read_mesh_input(o.input, context);
  if (mesh.triangles.empty())
    throw Error(ExitCode::unreadable,
                fmt::format("{}: has no faces: a point cloud, not a mesh; 'lamina surface' makes one of it",
                            shown_name(o.input)));
  context.info(tiles_text(write_tiles(mesh, settings, context)));
}

}  // namespace

void add_tiles(CLI::App& app) {
  auto* tool = app.add_subcommand("tiles", "Make a tree of levels of detail of a mesh: 3D Tiles");
  auto o = std::make_shared<TilesOptions>();
  tool->add_option("INPUT", o->input, "Mesh: .ply .obj .off .stl .glb, each also as .gz")->required();
  tool->add_option("-o,--output", o->tiles.folder, "Folder to be made, or an empty one")->required()->type_name("DIR");
  tool->add_flag("--plain", o->plain, "Contents without compression (EXT_meshopt_compression)");
  add_run_options(*tool, o->run);
  add_notes(*tool,
            "DIR/tileset.json is what viewers open. Every leaf has 30,000 to 60,000 triangles of the mesh as they are; "
            "coarser tiles are simplified from finer ones and meet their neighbours of any level without cracks. Where "
            "a PLY names a transverse Mercator coordinate system, as UTM, the tiles stand on the Earth.");
  add_examples(*tool, "  lamina tiles mesh.ply -o mesh_tiles");
  tool->callback([o] { run_tiles(*o); });
}

}  // namespace lamina::tools

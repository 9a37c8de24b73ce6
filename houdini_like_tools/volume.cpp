// lamina volume: a mesh as an OpenVDB level set.
#include "lamina/volume.h"

#include <fmt/format.h>

#include <map>
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

struct VolumeOptions {
  std::string mesh, output;
  VolumeSettings settings;
  RunOptions run;
};

void run_volume(const VolumeOptions& o) {
  require_volume_name(o.output);
  const RunContext context = make_context(o.run);
  const TriangleMesh mesh = read_mesh_input(o.mesh, context);
  VolumeStats stats;
  try {
    stats = write_volume(mesh, o.settings, o.output, context);
  } catch (const Error& e) {
    // The library knows the mesh, not its name.
    if (e.code() != ExitCode::unreadable && e.code() != ExitCode::empty) throw;
    throw Error(e.code(), o.mesh + ": " + e.what());
  }
  context.info(fmt::format("{} voxels of {:.4g}, {}{}, {}", count_text(stats.voxels), stats.voxel,
                           stats.has_sign ? "signed" : "unsigned", stats.has_colours ? " with colours" : "",
                           bytes_text(stats.bytes)));
}

}  // namespace

void add_grid_options(CLI::App& tool, VolumeSettings& s) {
  const std::string grid = "Grid";
  tool.add_option("--voxelsize,--voxel", s.voxel,
                  "Edge of a voxel in the mesh's units; 0: the mean length of its edges")
      ->type_name("LENGTH")
      ->capture_default_str()
      ->group(grid);
  tool.add_option("--halfbandvoxels,--band", s.band,
                  "Half width of the band that holds distances, in voxels, 1 to 1000")
      ->type_name("N")
      ->capture_default_str()
      ->group(grid);
  const std::map<std::string, VolumeSign> signs{
      {"auto", VolumeSign::automatic}, {"inside", VolumeSign::inside}, {"none", VolumeSign::none}};
  tool.add_option_function<std::string>(
          "--sign", [&s, signs](const std::string& word) { s.sign = signs.at(word); },
          "inside: negative inside, a level set; none: distances without a sign; auto: by whether the mesh is closed "
          "[auto]")
      ->check(CLI::IsMember({"auto", "inside", "none"}).description(""))
      ->type_name("auto|inside|none")
      ->group(grid);
  tool.add_option("--name", s.name, "Name of the distance grid, other than Cd")
      ->type_name("NAME")
      ->capture_default_str()
      ->group(grid);
  tool.add_flag_callback(
          "--no-colour,--no-color", [&s] { s.colours = false; }, "Leave out the colours (Cd)")
      ->group(grid);
  tool.add_flag("--half", s.half, "Store 16-bit floats: half the file")->group(grid);
}

void add_volume(CLI::App& app) {
  auto* tool = app.add_subcommand("volume", "Convert a mesh to an OpenVDB narrow-band level set");
  auto o = std::make_shared<VolumeOptions>();
  tool->add_option("MESH", o->mesh, "Mesh to convert: .ply .obj .off .stl .glb, each also as .gz")
      ->required()
      ->type_name("");
  tool->add_option("-o,--output", o->output, "Volume to write: .vdb, - for standard output")
      ->required()
      ->type_name("FILE");
  add_grid_options(*tool, o->settings);
  add_run_options(*tool, o->run);
  add_notes(
      *tool,
      "A closed mesh becomes a level set with exact distances, negative inside. A mesh with a boundary becomes "
      "distances without a sign, and the tool says so. Colours become a second grid Cd (0 to 1, as they stand in the "
      "file) with the colour of the nearest point. Both lie in the mesh's own coordinates, voxels on multiples of "
      "their edge. Equal meshes give equal bytes. Mesh and volume are held in memory.");
  add_examples(*tool, "  lamina volume mesh.ply --voxelsize 0.05 -o mesh.vdb");
  tool->callback([o] { run_volume(*o); });
}

}  // namespace lamina::tools

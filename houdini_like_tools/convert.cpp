// lamina convert: the same points or mesh in another format.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <memory>

#include "console.h"
#include "inputs.h"
#include "lamina/edit_points.h"
#include "lamina/error.h"
#include "lamina/volume.h"
#include "text.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct ConvertOptions {
  std::string input, output;
  bool vertices = false;
  VolumeSettings volume;
  BadSamples bad = BadSamples::drop;
  Precision precision = Precision::automatic;
  RunOptions run;
};

std::string ending(const std::string& path) {
  std::string e = std::filesystem::path(path).extension().string();
  std::transform(e.begin(), e.end(), e.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return e;
}

void convert_points(const ConvertOptions& o, const RunContext& context) {
  const std::string to = ending(o.output);
  if (to == ".off" || to == ".stl" || to == ".vdb")
    throw Error(ExitCode::usage, fmt::format("{}: points do not become a {} file: make a mesh of them with 'lamina "
                                             "surface' first",
                                             shown_name(o.input), to));
  const auto source = open_points(o.input, o.run.tmp_dir);
  const auto writer = open_points_writer(o.output, with_precision(columns_of(source->info()), o.precision),
                                         {.count = {}, .tmp_dir = o.run.tmp_dir});
  const EditReport report = edit_points(*source, *writer, {}, o.bad, context);
  warn_of_bad_rows(report, shown_name(o.input), context);
  writer->commit();
  context.info(fmt::format("wrote {} points", count_text(report.written)));
}

void write_vertices(const ConvertOptions& o, const TriangleMesh& mesh, const RunContext& context) {
  SampleBatch rows;
  for (const auto& p : mesh.positions) {
    rows.x.push_back(p[0]);
    rows.y.push_back(p[1]);
    rows.z.push_back(p[2]);
  }
  for (const auto& n : mesh.normals) {
    rows.nx.push_back(n[0]);
    rows.ny.push_back(n[1]);
    rows.nz.push_back(n[2]);
  }
  rows.attributes = mesh.attributes;
  const bool exact_as_float = std::all_of(mesh.positions.begin(), mesh.positions.end(), [](const auto& p) {
    return std::all_of(p.begin(), p.end(), [](double c) { return static_cast<double>(static_cast<float>(c)) == c; });
  });
  PointColumns columns;
  columns.double_positions = !exact_as_float;
  columns.normals = !mesh.normals.empty();
  columns.attributes = mesh.layout;
  const auto writer = open_points_writer(o.output, with_precision(columns, o.precision),
                                         {.count = rows.size(), .tmp_dir = o.run.tmp_dir});
  writer->append(rows);
  writer->commit();
  context.info(fmt::format("wrote {} vertices as points", count_text(rows.size())));
}

void convert_mesh(const ConvertOptions& o, const RunContext& context) {
  const TriangleMesh mesh = read_mesh(o.input);
  if (o.vertices) return write_vertices(o, mesh, context);
  if (ending(o.output) != ".vdb") {
    write_mesh(mesh, o.output);
    context.info(fmt::format("wrote {} vertices, {} triangles", count_text(mesh.positions.size()),
                             count_text(mesh.triangles.size())));
    return;
  }
  const VolumeStats stats = write_volume(mesh, o.volume, o.output, context);
  context.info(fmt::format("{} voxels of {:.4g}, {}", count_text(stats.voxels), stats.voxel,
                           stats.has_sign ? "signed" : "unsigned"));
}

void run_convert(const ConvertOptions& o) {
  const RunContext context = make_context(o.run);
  switch (content_of(o.input, o.run.tmp_dir)) {
    case FileContent::points:
      return convert_points(o, context);
    case FileContent::mesh:
      return convert_mesh(o, context);
    case FileContent::volume:
      throw Error(ExitCode::usage, o.input + ": volumes cannot be converted");
  }
}

}  // namespace

void add_convert(CLI::App& app) {
  auto* tool = app.add_subcommand("convert", "Write points or a mesh in another format");
  auto o = std::make_shared<ConvertOptions>();
  add_files(*tool, o->input, "Points (streamed) or mesh", o->output,
            "Points, mesh (.ply .obj .off .stl) or, of a mesh, a level set (.vdb)");
  tool->add_flag("--vertices", o->vertices, "Write a mesh's vertices as points")->group("Output");
  tool->add_option("--voxelsize", o->volume.voxel, "Level set: edge of a voxel; 0: the mean length of the edges")
      ->type_name("LENGTH")
      ->capture_default_str()
      ->group("Output");
  tool->add_option("--halfbandvoxels", o->volume.band, "Level set: half width of its band, in voxels")
      ->type_name("N")
      ->capture_default_str()
      ->group("Output");
  add_bad_samples(*tool, o->bad);
  add_precision(*tool, o->precision);
  add_run_options(*tool, o->run);
  add_examples(*tool,
               "  lamina convert mesh.ply -o mesh.obj\n"
               "  lamina convert mesh.ply -o mesh.vdb --voxelsize 0.05\n"
               "  lamina convert scan.ply --precision double -o scan_double.ply");
  tool->callback([o] { run_convert(*o); });
}

}  // namespace lamina::tools

// lamina convert: the same points or mesh in another format.
#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "common/console.h"
#include "common/help.h"
#include "common/inputs.h"
#include "common/outputs.h"
#include "common/text.h"
#include "lamina/edit.h"
#include "lamina/error.h"
#include "lamina/file_ending.h"
#include "lamina/mesh.h"
#include "lamina/volume.h"
#include "lamina/volume_points.h"
#include "lamina/volume_tools.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct ConvertOptions {
  std::string input, output;
  PointSettings reading;
  std::string grid;
  bool vertices = false, fog = false;
  MeshingSettings meshing;
  VolumeSettings volume;
  BadSamples bad = BadSamples::drop;
  Precision precision = Precision::automatic;
  RunOptions run;
};

template <class T>
void append(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

/// OpenVDB's points grid is made of the whole cloud.
void points_to_volume(const ConvertOptions& o, PointSource& source, const RunContext& context) {
  PointArrays all;
  all.layout = source.info().attributes;
  all.samples.attributes.resize(all.layout.size());
  SampleBatch batch;
  constexpr std::size_t kBatch = std::size_t{1} << 16;
  EditReport report;
  for (std::uint64_t first = 0; first < source.info().count; first += kBatch) {
    if (context.cancelled()) throw Error(ExitCode::internal, "cancelled");
    source.read(first, kBatch, batch);
    const EditReport part = clean_rows(batch);
    if (part.bad_rows > 0 && o.bad == BadSamples::refuse) refuse_bad_row(part, shown_name(o.input));
    add(report, part);
    SampleBatch& s = all.samples;
    append(s.x, batch.x), append(s.y, batch.y), append(s.z, batch.z);
    append(s.nx, batch.nx), append(s.ny, batch.ny), append(s.nz, batch.nz);
    append(s.radius, batch.radius), append(s.quality, batch.quality);
    for (std::size_t a = 0; a < all.layout.size(); ++a) append(s.attributes[a], batch.attributes[a]);
  }
  warn_of_bad_rows(report, shown_name(o.input), context);
  PointVolumeSettings settings;
  settings.voxel = o.volume.voxel;
  if (!o.grid.empty()) settings.name = o.grid;
  const PointVolumeStats stats = write_point_volume(all, settings, o.output, context);
  context.info(fmt::format("{} points in {} voxels of {:.4g}, {}", count_text(stats.points), count_text(stats.voxels),
                           stats.voxel, bytes_text(stats.bytes)));
}

void convert_points(const ConvertOptions& o, const RunContext& context) {
  const std::string to = file_ending(o.output);
  if (to == ".vdb") return points_to_volume(o, *open_point_input(o.input, o.reading, context), context);
  if (to == ".off" || to == ".stl" || to == ".glb")
    throw Error(ExitCode::usage, fmt::format("{}: points do not become a {} file: make a mesh of them with 'lamina "
                                             "surface' first",
                                             shown_name(o.input), to));
  const auto source = open_point_input(o.input, o.reading, context);
  const auto writer = open_points_writer(
      o.output, with_precision(columns_of(source->info()), o.precision),
      {.count = {}, .tmp_dir = o.run.tmp_dir, .crs = source->info().crs, .geographic = source->info().geographic});
  const EditReport report = edit_points(*source, *writer, {}, o.bad, context);
  warn_of_bad_rows(report, shown_name(o.input), context);
  writer->commit();
  context.info(fmt::format("wrote {} points", count_text(report.written)));
}

void write_vertices(const ConvertOptions& o, const TriangleMesh& mesh, const RunContext& context) {
  const SampleBatch rows = vertices_of(mesh);
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
  if (!o.vertices && !o.fog) {
    if (const auto converted = convert_mesh_file(o.input, o.output, context)) {
      context.info(fmt::format("wrote {} vertices, {} triangles", count_text(converted->vertices),
                               count_text(converted->triangles)));
      return;
    }
  }
  const TriangleMesh mesh = read_mesh_input(o.input, context, o.bad);
  if (o.vertices) return write_vertices(o, mesh, context);
  if (o.fog)
    throw Error(ExitCode::usage, shown_name(o.input) + ": --fog wants a level set; make a .vdb of the mesh first");
  if (file_ending(o.output) != ".vdb") {
    write_mesh(mesh, o.output);
    context.info(fmt::format("wrote {} vertices, {} triangles", count_text(mesh.positions.size()),
                             count_text(mesh.triangles.size())));
    return;
  }
  const VolumeStats stats = write_volume(mesh, o.volume, o.output, context);
  context.info(fmt::format("{} voxels of {:.4g}, {}", count_text(stats.voxels), stats.voxel,
                           stats.has_sign ? "signed" : "unsigned"));
}

void volume_points_to_points(const ConvertOptions& o, const RunContext& context) {
  const PointVolume volume = read_point_volume(o.input, o.grid);
  for (const std::string& name : volume.skipped)
    context.warn(fmt::format("{}: attribute {} is neither a number nor a vector; left out", o.input, name));
  const SampleBatch& s = volume.points.samples;
  PointColumns columns;
  columns.double_positions = std::any_of(s.x.begin(), s.x.end(), [](double c) { return double(float(c)) != c; }) ||
                             std::any_of(s.y.begin(), s.y.end(), [](double c) { return double(float(c)) != c; }) ||
                             std::any_of(s.z.begin(), s.z.end(), [](double c) { return double(float(c)) != c; });
  columns.normals = !s.nx.empty();
  if (!s.radius.empty()) columns.radius = "radius";
  if (!s.quality.empty()) columns.quality = "quality";
  columns.attributes = volume.points.layout;
  const auto writer =
      open_points_writer(o.output, with_precision(columns, o.precision), {.count = s.size(), .tmp_dir = o.run.tmp_dir});
  writer->append(s);
  writer->commit();
  context.info(fmt::format("wrote {} points", count_text(s.size())));
}

void convert_volume(const ConvertOptions& o, const RunContext& context) {
  const VolumeInfo info = describe_volume(o.input);
  const auto chosen = std::find_if(info.grids.begin(), info.grids.end(),
                                   [&](const GridInfo& g) { return o.grid.empty() ? g.points : g.name == o.grid; });
  const bool points_only =
      std::all_of(info.grids.begin(), info.grids.end(), [](const GridInfo& g) { return g.points; });
  if (chosen != info.grids.end() && chosen->points && (points_only || !o.grid.empty()))
    return volume_points_to_points(o, context);
  const LevelSet level_set = read_level_set(o.input, o.grid);
  if (file_ending(o.output) == ".vdb") {
    if (!o.fog)
      throw Error(ExitCode::usage,
                  fmt::format("{}: is a volume already; --fog makes a fog volume of its level set", o.input));
    const std::uint64_t bytes = write_fog(level_set, {"density", 0, o.volume.half}, o.output, context);
    context.info(fmt::format("a fog volume of {}", bytes_text(bytes)));
    return;
  }
  const TriangleMesh mesh = mesh_level_set(level_set, o.meshing, context);
  write_mesh(mesh, o.output);
  context.info(fmt::format("wrote {} vertices, {} triangles", count_text(mesh.positions.size()),
                           count_text(mesh.triangles.size())));
}

void run_convert(const ConvertOptions& o) {
  const RunContext context = make_context(o.run, o.output);
  switch (content_of(o.input, o.run.tmp_dir)) {
    case FileContent::points:
      return convert_points(o, context);
    case FileContent::mesh:
      return convert_mesh(o, context);
    case FileContent::volume:
      return convert_volume(o, context);
  }
}

}  // namespace

void add_convert(CLI::App& app) {
  auto* tool = app.add_subcommand("convert", "Write points or a mesh in another format");
  auto o = std::make_shared<ConvertOptions>();
  add_files(
      *tool, o->input, "Points (streamed), mesh or volume (.vdb: level set or points)", o->output,
      "File to write: points (.ply .xyz .csv .pcd .las .laz .e57), mesh (.ply .obj .off .stl .glb) or volume (.vdb)");
  tool->add_flag("--vertices", o->vertices, "Write a mesh's vertices as points")->group("Output");
  const std::string volume = "Volume";
  tool->add_option("--grid", o->grid, "Name of the grid to read, or of the points grid to write")
      ->type_name("NAME")
      ->group(volume);
  tool->add_option("--voxelsize", o->volume.voxel,
                   "Edge of a voxel; 0: the mean length of the mesh's edges, or eight points in a voxel")
      ->type_name("LENGTH")
      ->capture_default_str()
      ->group(volume);
  tool->add_option("--halfbandvoxels", o->volume.band, "Half width of a level set's band, in voxels, 1 to 1000")
      ->type_name("N")
      ->capture_default_str()
      ->group(volume);
  tool->add_option("--adaptivity", o->meshing.adaptivity, "Mesh of a level set: simplify flat parts, 0 to 1")
      ->type_name("A")
      ->capture_default_str()
      ->group(volume);
  tool->add_option("--isovalue", o->meshing.isovalue,
                   "Mesh of a level set: at this distance from the surface, inside its band")
      ->type_name("LENGTH")
      ->capture_default_str()
      ->group(volume);
  tool->add_flag("--fog", o->fog, "Make a fog volume (grid density) of a level set")->group(volume);
  tool->add_flag("--half", o->volume.half, "Store a level set or fog in 16-bit floats")->group(volume);
  add_point_options(*tool, o->reading);
  add_bad_samples(*tool, o->bad, "Points and vertices");
  add_precision(*tool, o->precision);
  add_run_options(*tool, o->run);
  add_notes(
      *tool,
      "The ending of the output says what is made. A mesh becomes a level set where that is .vdb, and a level set a "
      "mesh where it is not; points become an OpenVDB points grid, and such a grid points. Points stream from file "
      "to file; meshes, volumes and points on their way to or from a .vdb are held in memory.");
  add_examples(*tool,
               "  lamina convert mesh.ply -o mesh.obj\n"
               "  lamina convert mesh.ply -o mesh.glb\n"
               "  lamina convert mesh.ply -o mesh.vdb --voxelsize 0.05\n"
               "  lamina convert mesh.vdb -o remeshed.ply\n"
               "  lamina convert mesh.vdb --fog -o fog.vdb\n"
               "  lamina convert scan.ply -o scan.vdb\n"
               "  lamina convert scan.ply --precision double -o scan_double.ply");
  tool->callback([o, tool] {
    if (file_ending(o->output) != ".vdb") {
      for (const char* name : {"--voxelsize", "--halfbandvoxels", "--half", "--fog"})
        if (tool->count(name) > 0) throw CLI::ValidationError(name, "is for .vdb files; name one with --output");
    }
    run_convert(*o);
  });
}

}  // namespace lamina::tools

// lamina clip: the part of points, a mesh or volumes inside a box or before planes.
#include "lamina/edit.h"

#include <fmt/format.h>

#include <map>
#include <memory>

#include "common/console.h"
#include "common/help.h"
#include "common/inputs.h"
#include "common/options.h"
#include "common/outputs.h"
#include "common/text.h"
#include "lamina/error.h"
#include "lamina/volume_tools.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct ClipOptions {
  std::string input, output;
  PointSettings reading;
  ClipRegion region;
  Keep keep = Keep::inside;
  BadSamples bad = BadSamples::drop;
  Precision precision = Precision::automatic;
  RunOptions run;
};

[[noreturn]] void nothing_left(const ClipOptions& o) {
  throw Error(ExitCode::empty, fmt::format("{}: nothing of it lies {} the region; 'lamina info' tells where it lies",
                                           shown_name(o.input), o.keep == Keep::inside ? "inside" : "outside"));
}

void clip_points(const ClipOptions& o, const RunContext& context) {
  PointSettings reading = o.reading;
  if (o.region.box && o.keep == Keep::inside) reading.select.box = {o.region.box->low, o.region.box->high};
  const auto source = open_point_input(o.input, reading, context);
  const auto writer = open_points_writer(
      o.output, with_precision(columns_of(source->info()), o.precision),
      {.count = {}, .tmp_dir = o.run.tmp_dir, .crs = source->info().crs, .geographic = source->info().geographic});
  const EditReport report = edit_points(
      *source, *writer, [&](SampleBatch& batch) { clip_rows(batch, o.region, o.keep); }, o.bad, context);
  warn_of_bad_rows(report, shown_name(o.input), context);
  if (report.written == 0) nothing_left(o);
  writer->commit();
  context.info(fmt::format("kept {} of {} points", count_text(report.written), count_text(report.read)));
}

void clip_triangles(const ClipOptions& o, const RunContext& context) {
  const TriangleMesh mesh = read_mesh_input(o.input, context, o.bad);
  const TriangleMesh clipped = clip_mesh(mesh, o.region, o.keep, context);
  if (clipped.positions.empty()) nothing_left(o);
  write_mesh(clipped, o.output);
  context.info(
      fmt::format("{} triangles of {}", count_text(clipped.triangles.size()), count_text(mesh.triangles.size())));
}

void clip_grids(const ClipOptions& o, const RunContext& context) {
  require_volume_name(o.output);
  const VolumeEditStats stats = clip_volume(o.input, o.region, o.keep, o.output, context);
  context.info(volume_text("kept", stats));
}

void run_clip(const ClipOptions& o) {
  require_sane(o.region);
  const RunContext context = make_context(o.run, o.output);
  switch (content_of(o.input, o.run.tmp_dir)) {
    case FileContent::points:
      return clip_points(o, context);
    case FileContent::mesh:
      return clip_triangles(o, context);
    case FileContent::volume:
      return clip_grids(o, context);
  }
}

}  // namespace

void add_clip(CLI::App& app) {
  auto* tool = app.add_subcommand("clip", "Keep what lies inside a box or before planes");
  auto o = std::make_shared<ClipOptions>();
  add_files(*tool, o->input, "Points (streamed), mesh (triangles are cut) or .vdb (voxels are kept or not)", o->output,
            "File of the same kind");
  add_numbers(*tool, "--box", {"X0,Y0,Z0,X1,Y1,Z1", 6}, "Keep what lies in this box, given by two corners",
              [o](const auto& v) {
                o->region.box = Box{{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
              })
      ->group("Region");
  add_repeated_numbers(
      *tool, "--plane", {"X,Y,Z,NX,NY,NZ", 6},
      "Keep what lies on the side of the plane through X,Y,Z to which NX,NY,NZ points; may be repeated",
      [o](const auto& v) {
        o->region.half_spaces.push_back({{v[0], v[1], v[2]}, {v[3], v[4], v[5]}});
      })
      ->group("Region");
  const std::map<std::string, Keep> words{{"inside", Keep::inside}, {"outside", Keep::outside}};
  tool->add_option_function<std::string>(
          "--keep", [o, words](const std::string& word) { o->keep = words.at(word); },
          "Which side of the region [inside]")
      ->check(CLI::IsMember({"inside", "outside"}).description(""))
      ->type_name("inside|outside")
      ->group("Region");
  add_point_options(*tool, o->reading);
  add_bad_samples(*tool, o->bad, "Points and vertices");
  add_precision(*tool, o->precision);
  add_run_options(*tool, o->run);
  add_notes(
      *tool,
      "Points and voxels are kept or not. Triangles are cut, and the cut edges stay open; a level set is open from "
      "then on. Points stream, meshes and volumes are held.");
  add_examples(*tool,
               "  lamina clip scan.ply --box -1,0,-1,1,0.8,1 -o part.ply\n"
               "  lamina clip mesh.ply --plane 0,0,0,0,1,0 -o upper.ply\n"
               "  lamina clip mesh.vdb --plane 0,0,0,0,1,0 -o upper.vdb");
  tool->callback([o] { run_clip(*o); });
}

}  // namespace lamina::tools

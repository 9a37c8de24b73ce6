// lamina transform: move, turn and scale points, a mesh or volumes.
#include "lamina/edit.h"

#include <fmt/format.h>

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

struct TransformOptions {
  std::string input, output;
  PointSettings reading;
  TransformSettings settings;
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  bool has_matrix = false, invert = false;
  BadSamples bad = BadSamples::drop;
  Precision precision = Precision::automatic;
  RunOptions run;
};

Eigen::Affine3d affine(const TransformOptions& o) {
  Eigen::Affine3d t = make_transform(o.settings);
  if (o.has_matrix) {
    require_invertible(o.matrix);
    t = Eigen::Affine3d(o.matrix);
  }
  return o.invert ? t.inverse() : t;
}

/// The box of the moved points' box: enough to know whether floats will do.
bool needs_double(PointSource& source, const Eigen::Affine3d& transform, const RunContext& context) {
  const PointsInfo info = describe_points(source, context);
  Eigen::AlignedBox3d box;
  for (int corner = 0; corner < 8; ++corner) {
    const auto at = [&](int k) { return (corner >> k & 1) != 0 ? info.high.at(k) : info.low.at(k); };
    box.extend(transform * Eigen::Vector3d(at(0), at(1), at(2)));
  }
  return wants_double(box.min(), box.max());
}

void transform_points(const TransformOptions& o, const Eigen::Affine3d& transform, const RunContext& context) {
  const auto source = open_point_input(o.input, o.reading, context);
  PointColumns columns = with_precision(columns_of(source->info()), o.precision);
  if (o.precision == Precision::automatic && !columns.double_positions)
    columns.double_positions = needs_double(*source, transform, context);
  const auto writer = open_points_writer(o.output, columns, {.count = {}, .tmp_dir = o.run.tmp_dir});
  const EditReport report = edit_points(
      *source, *writer, [&](SampleBatch& batch) { transform_rows(batch, transform); }, o.bad, context);
  warn_of_bad_rows(report, shown_name(o.input), context);
  writer->commit();
  context.info(fmt::format("moved {} points", count_text(report.written)));
}

void transform_triangles(const TransformOptions& o, const Eigen::Affine3d& transform, const RunContext& context) {
  TriangleMesh mesh = read_mesh_input(o.input, context, o.bad);
  transform_mesh(mesh, transform);
  write_mesh(mesh, o.output);
  context.info(fmt::format("moved {} vertices", count_text(mesh.positions.size())));
}

void transform_grids(const TransformOptions& o, const Eigen::Affine3d& transform, const RunContext& context) {
  require_volume_name(o.output);
  context.info(volume_text("moved", transform_volume(o.input, transform, o.output, context)));
}

void run_transform(const TransformOptions& o) {
  const Eigen::Affine3d transform = affine(o);
  const RunContext context = make_context(o.run, o.output);
  switch (content_of(o.input, o.run.tmp_dir)) {
    case FileContent::points:
      return transform_points(o, transform, context);
    case FileContent::mesh:
      return transform_triangles(o, transform, context);
    case FileContent::volume:
      return transform_grids(o, transform, context);
  }
}

Eigen::Vector3d vector(const std::vector<double>& v) {
  return {v[0], v[1], v[2]};
}

}  // namespace

void add_transform(CLI::App& app) {
  auto* tool = app.add_subcommand("transform", "Move, turn and scale points, a mesh or volumes, normals with them");
  auto o = std::make_shared<TransformOptions>();
  add_files(*tool, o->input, "Points (streamed), mesh or .vdb (by its transforms; nothing is resampled)", o->output,
            "File of the same kind");
  const std::string group = "Transform";
  tool->add_option_function<std::string>(
          "--scale",
          [o](const std::string& text) {
            auto v = read_numbers(text, ',', 3);
            if (!v) {
              if (const auto one = read_numbers(text, ',', 1)) v = {(*one)[0], (*one)[0], (*one)[0]};
            }
            if (!v) throw CLI::ValidationError("--scale", fmt::format("'{}' is not of the form S or X,Y,Z", text));
            o->settings.scale = vector(*v);
          },
          "First: multiply by this, one number or one for each axis")
      ->type_name("S|X,Y,Z")
      ->group(group);
  add_numbers(*tool, "--rotate", {"X,Y,Z", 3}, "Then turn about the x, then the y, then the z axis, degrees",
              [o](const auto& v) { o->settings.rotate = vector(v); })
      ->group(group);
  add_numbers(*tool, "--translate", {"X,Y,Z", 3}, "Last: move by this", [o](const auto& v) {
    o->settings.translate = vector(v);
  })->group(group);
  add_numbers(*tool, "--pivot", {"X,Y,Z", 3}, "Turn and scale about this point [0,0,0]", [o](const auto& v) {
    o->settings.pivot = vector(v);
  })->group(group);
  auto* matrix =
      add_numbers(*tool, "--matrix", {"M11,M12,...,M44", 16},
                  "Instead: a 4x4 matrix row by row, the translation in the last column", [o](const auto& v) {
                    o->has_matrix = true;
                    for (int i = 0; i < 16; ++i) o->matrix(i / 4, i % 4) = v[static_cast<std::size_t>(i)];
                  });
  matrix->group(group);
  for (const char* other : {"--scale", "--rotate", "--translate", "--pivot"}) matrix->excludes(tool->get_option(other));
  tool->add_flag("--invert", o->invert, "Undo the transform instead")->group(group);
  add_point_options(*tool, o->reading);
  add_bad_samples(*tool, o->bad, "Points and vertices");
  add_precision(*tool, o->precision);
  add_run_options(*tool, o->run);
  add_notes(
      *tool,
      "All is computed in double. Normals turn with the positions; radii and distances grow with the scale. A mirrored "
      "mesh keeps its outside outside. Volumes move by their transforms, so no voxel is resampled; a level set cannot "
      "be stretched or sheared. Points stream, meshes and volumes are held.");
  add_examples(*tool,
               "  lamina transform scan.ply --scale 0.001 --rotate -90,0,0 -o metres_y_up.ply\n"
               "  lamina transform mesh.ply --translate -10,0,2.5 -o moved.obj\n"
               "  lamina transform mesh.vdb --scale 0.01 -o metres.vdb");
  tool->callback([o] { run_transform(*o); });
}

}  // namespace lamina::tools

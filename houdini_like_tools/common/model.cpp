#include "common/model.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "common/inputs.h"
#include "common/point_models.h"
#include "common/text.h"
#include "lamina/error.h"
#include "lamina/info.h"
#include "lamina/volume.h"
#include "lamina/volume_points.h"
#include "lamina/volume_tools.h"

namespace lamina::tools {
namespace {

class HeldMesh : public Model {
 public:
  explicit HeldMesh(TriangleMesh mesh) : mesh_(std::move(mesh)) {}
  void frame(Renderer& renderer) override { renderer.frame(mesh_); }
  void draw(Renderer& renderer) override { renderer.draw(mesh_); }
  [[nodiscard]] std::string what() const override { return count_text(mesh_.triangles.size()) + " triangles"; }

 private:
  TriangleMesh mesh_;
};

class HeldLevelSet : public Model {
 public:
  explicit HeldLevelSet(LevelSet level_set) : level_set_(std::move(level_set)) {}
  void frame(Renderer& renderer) override { renderer.frame(level_set_); }
  void draw(Renderer& renderer) override { renderer.draw(level_set_); }
  [[nodiscard]] std::string what() const override {
    return fmt::format("level set {}, voxels of {:.4g}", level_set_.name(), level_set_.voxel());
  }

 private:
  LevelSet level_set_;
};

class HeldFog : public Model {
 public:
  explicit HeldFog(FogVolume fog) : fog_(std::move(fog)) {}
  void frame(Renderer& renderer) override { renderer.frame(fog_); }
  void draw(Renderer& renderer) override { renderer.draw(fog_); }
  [[nodiscard]] std::string what() const override {
    return fmt::format("fog {}, voxels of {:.4g}", fog_.name(), fog_.voxel());
  }

 private:
  FogVolume fog_;
};

/// A mesh file's vertices, where it has nothing but vertices.
PointArrays as_points(TriangleMesh& mesh) {
  PointArrays points;
  points.samples = vertices_of(mesh);
  points.layout = std::move(mesh.layout);
  return points;
}

std::vector<double> values_to_paint(const TriangleMesh& mesh, const std::string& path, const PaintOptions& paint,
                                    const RunContext& context) {
  if (paint.what == "distance") return vertex_distances(mesh, read_reference(paint.reference, context), context);
  std::string names;
  for (std::size_t a = 0; a < mesh.layout.size(); ++a) {
    if (mesh.layout[a].name == paint.what) return {mesh.attributes[a].begin(), mesh.attributes[a].end()};
    names += (a > 0 ? ", " : "") + mesh.layout[a].name;
  }
  throw Error(ExitCode::usage,
              fmt::format("{}: --paint {}: no such attribute; there is distance (with --reference), {}", path,
                          paint.what, names.empty() ? "nothing else" : names));
}

void paint_mesh(TriangleMesh& mesh, const std::string& path, const PaintOptions& options, const RunContext& context) {
  const std::vector<double> values = values_to_paint(mesh, path, options, context);
  const PaintRange range = options.range ? *options.range : paint_range(values);
  paint(mesh, values, range);
  const auto [least, most] = std::minmax_element(values.begin(), values.end());
  say_scale(options.what, range, *least, *most, context);
}

std::unique_ptr<Model> model_of(TriangleMesh mesh, const std::string& path, const PaintOptions& paint,
                                const RunContext& context) {
  if (mesh.positions.empty()) throw Error(ExitCode::empty, fmt::format("{}: no vertices to draw", path));
  if (!paint.what.empty()) paint_mesh(mesh, path, paint, context);
  if (!mesh.triangles.empty()) return std::make_unique<HeldMesh>(std::move(mesh));
  const std::string what = count_text(mesh.positions.size()) + " vertices; there are no faces";
  return held_points(as_points(mesh), what, path, {}, context);
}

std::unique_ptr<Model> volume_model(const std::string& path, const ModelOptions& options, const RunContext& context) {
  const VolumeInfo info = describe_volume(path);
  const auto of_that_name = [&](const GridInfo& g) { return g.name == options.grid; };
  const auto chosen = std::find_if(info.grids.begin(), info.grids.end(), of_that_name);
  const auto is_points = [](const GridInfo& g) { return g.points; };
  const auto is_fog = [](const GridInfo& g) { return g.grid_class == "fog volume"; };
  const auto is_level_set = [](const GridInfo& g) { return g.grid_class == "level set"; };
  const bool points = options.grid.empty() ? std::all_of(info.grids.begin(), info.grids.end(), is_points)
                                           : chosen != info.grids.end() && chosen->points;
  if (points) {
    PointVolume volume = read_point_volume(path, options.grid);
    if (volume.points.samples.size() == 0) throw Error(ExitCode::empty, fmt::format("{}: no points to draw", path));
    const std::string what = count_text(volume.points.samples.size()) + " points";
    return held_points(std::move(volume.points), what, path, options.paint, context);
  }
  const bool fog = options.grid.empty() ? std::none_of(info.grids.begin(), info.grids.end(), is_level_set) &&
                                              std::any_of(info.grids.begin(), info.grids.end(), is_fog)
                                        : chosen != info.grids.end() && is_fog(*chosen);
  if (fog) {
    if (options.as_triangles || !options.paint.what.empty()) {
      throw Error(ExitCode::usage, fmt::format("{}: a fog has no triangles: --flat, --wireframe, --mark-boundary and "
                                               "--paint are for meshes, points and level sets",
                                               path));
    }
    return std::make_unique<HeldFog>(read_fog(path, options.grid));
  }
  LevelSet level_set = read_level_set(path, options.grid);
  if (!options.as_triangles && options.paint.what.empty()) return std::make_unique<HeldLevelSet>(std::move(level_set));
  return model_of(mesh_level_set(level_set, {}, context), path, options.paint, context);
}

}  // namespace

std::unique_ptr<Model> open_model(const std::string& path, const ModelOptions& options, const RunContext& context) {
  switch (content_of(path, context.tmp_dir)) {
    case FileContent::mesh:
      return model_of(read_mesh(path), path, options.paint, context);
    case FileContent::volume:
      return volume_model(path, options, context);
    case FileContent::points:
      break;
  }
  return streamed_points(path, options.paint, context);
}

std::unique_ptr<Model> hold_mesh(TriangleMesh mesh, const std::string& name, const PaintOptions& paint,
                                 const RunContext& context) {
  return model_of(std::move(mesh), name, paint, context);
}

std::unique_ptr<Model> open_vertices(const std::string& path, const RunContext& context) {
  return streamed_points(path, {}, context);
}

}  // namespace lamina::tools

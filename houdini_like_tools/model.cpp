#include "model.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "inputs.h"
#include "lamina/error.h"
#include "lamina/info.h"
#include "lamina/points.h"
#include "lamina/volume_fog.h"
#include "lamina/volume_info.h"
#include "lamina/volume_points.h"
#include "text.h"

namespace lamina::tools {
namespace {

constexpr std::size_t kBatch = std::size_t{1} << 20;  // points held at a time

class StreamedPoints : public Model {
 public:
  StreamedPoints(const std::string& path, const RunContext& context)
      : source_(open_point_input(path, {}, context)), context_(context) {
    if (source_->info().count == 0) throw Error(ExitCode::empty, fmt::format("{}: no points to draw", path));
  }
  void frame(Renderer& renderer) override {
    for_batches("frame", [&](const SampleBatch& batch) { renderer.frame(batch); });
  }
  void draw(Renderer& renderer) override {
    for_batches("draw", [&](const SampleBatch& batch) { renderer.draw(batch, source_->info().attributes); });
  }
  [[nodiscard]] std::string what() const override { return count_text(source_->info().count) + " points"; }

 private:
  /// Every batch of the file, with progress.
  template <class Take>
  void for_batches(std::string_view stage, const Take& take) {
    SampleBatch batch;
    const std::uint64_t total = source_->info().count;
    for (std::uint64_t first = 0; first < total; first += batch.size()) {
      if (context_.cancelled()) throw Error(ExitCode::internal, "cancelled");
      source_->read(first, kBatch, batch);
      take(batch);
      if (context_.progress) context_.progress({stage, first + batch.size(), total, 0, 0});
    }
  }
  std::unique_ptr<PointSource> source_;
  const RunContext& context_;
};

class HeldPoints : public Model {
 public:
  HeldPoints(PointArrays points, std::string what) : points_(std::move(points)), what_(std::move(what)) {}
  void frame(Renderer& renderer) override { renderer.frame(points_.samples); }
  void draw(Renderer& renderer) override { renderer.draw(points_.samples, points_.layout); }
  [[nodiscard]] std::string what() const override { return what_; }

 private:
  PointArrays points_;
  std::string what_;
};

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
  SampleBatch& s = points.samples;
  for (const auto& p : mesh.positions) {
    s.x.push_back(p[0]);
    s.y.push_back(p[1]);
    s.z.push_back(p[2]);
  }
  for (const auto& n : mesh.normals) {
    s.nx.push_back(n[0]);
    s.ny.push_back(n[1]);
    s.nz.push_back(n[2]);
  }
  s.attributes = std::move(mesh.attributes);
  points.layout = std::move(mesh.layout);
  return points;
}

std::vector<double> values_to_paint(const TriangleMesh& mesh, const std::string& path, const PaintOptions& paint,
                                    const RunContext& context) {
  if (paint.what == "distance") return vertex_distances(mesh, read_mesh_input(paint.reference, context), context);
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
  context.info(fmt::format(
      "painted {}: dark blue {:.4g}, turquoise {:.4g}, yellow-green {:.4g}, orange {:.4g}, dark red "
      "{:.4g}; values lie between {:.4g} and {:.4g}",
      options.what, range.low, range.low + 0.25 * (range.high - range.low), range.low + 0.5 * (range.high - range.low),
      range.low + 0.75 * (range.high - range.low), range.high, *least, *most));
}

std::unique_ptr<Model> model_of(TriangleMesh mesh, const std::string& path, const PaintOptions& paint,
                                const RunContext& context) {
  if (mesh.positions.empty()) throw Error(ExitCode::empty, fmt::format("{}: no vertices to draw", path));
  if (!paint.what.empty()) paint_mesh(mesh, path, paint, context);
  if (!mesh.triangles.empty()) return std::make_unique<HeldMesh>(std::move(mesh));
  const std::string what = count_text(mesh.positions.size()) + " vertices; there are no faces";
  return std::make_unique<HeldPoints>(as_points(mesh), what);
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
    return std::make_unique<HeldPoints>(std::move(volume.points), what);
  }
  const bool fog = options.grid.empty() ? std::none_of(info.grids.begin(), info.grids.end(), is_level_set) &&
                                              std::any_of(info.grids.begin(), info.grids.end(), is_fog)
                                        : chosen != info.grids.end() && is_fog(*chosen);
  if (fog) {
    if (options.as_triangles || !options.paint.what.empty()) {
      throw Error(ExitCode::usage, fmt::format("{}: a fog has no triangles: --flat, --wireframe, --mark-boundary and "
                                               "--paint are for meshes and level sets",
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
  if (!options.paint.what.empty()) {
    throw Error(ExitCode::usage, fmt::format("{}: --paint is for meshes; 'lamina surface' makes one of points", path));
  }
  return std::make_unique<StreamedPoints>(path, context);
}

std::unique_ptr<Model> open_vertices(const std::string& path, const RunContext& context) {
  return std::make_unique<StreamedPoints>(path, context);
}

}  // namespace lamina::tools

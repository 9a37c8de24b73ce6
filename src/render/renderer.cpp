#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>

#include "lamina/error.h"
#include "lamina/render.h"
#include "measure/edge_table.h"
#include "meshes/vec3.h"
#include "render/canvas.h"

namespace lamina {

using namespace render_detail;

namespace {

constexpr int kLargestSide = 16384;

void check(const RenderSettings& s) {
  const auto demand = [](bool holds, std::string_view what) {
    if (!holds) throw Error(ExitCode::usage, fmt::format("cannot draw: {}", what));
  };
  demand(s.width >= 1 && s.width <= kLargestSide && s.height >= 1 && s.height <= kLargestSide,
         "the picture's sides must be 1 to 16384 pixels");
  demand(s.supersample >= 1 && s.supersample <= 8, "samples per pixel must be 1 to 8");
  demand(s.views >= 1 && s.views <= 16, "the number of views must be 1 to 16");
  demand(s.frames >= 1 && s.frames <= 9999, "the number of frames must be 1 to 9999");
  demand(s.up >= 0 && s.up <= 2, "the up axis must be x, y or z");
  demand(std::isfinite(s.azimuth), "the azimuth must be finite");
  demand(std::abs(s.elevation) <= 90, "the elevation must be -90 to 90 degrees");
  demand(s.point_radius >= 0 && std::isfinite(s.point_radius), "the point radius must be finite and not negative");
  if (s.zoom) {
    demand(s.zoom->radius > 0 && std::isfinite(s.zoom->radius), "the zoom's radius must be positive");
    for (const double c : s.zoom->centre) demand(std::isfinite(c), "the zoom's centre must be finite");
  }
}

Canvas make_canvas(const RenderSettings& settings, const RunContext& context) {
  check(settings);
  const auto samples = static_cast<std::size_t>(settings.width) * static_cast<std::size_t>(settings.height) *
                       static_cast<std::size_t>(settings.supersample * settings.supersample);
  const std::size_t bytes = samples * (sizeof(float) + 4);
  if (context.max_memory != 0 && bytes > context.max_memory) {
    throw Error(ExitCode::budget,
                fmt::format("the picture needs {} bytes and the memory limit is {}; ask for a smaller one or "
                            "fewer samples per pixel",
                            bytes, context.max_memory));
  }
  return {settings.width * settings.supersample, settings.height * settings.supersample};
}

bool finite(const std::array<double, 3>& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

}  // namespace

struct Renderer::Impl {
  Impl(const RenderSettings& s, const RunContext& c)
      : settings(s),
        context(c),
        canvas(make_canvas(s, c)),
        views(make_views(s)),
        framing(framing_views(s)),
        extents(framing.size()),
        arena(c.threads > 0 ? c.threads : tbb::task_arena::automatic) {}

  // `visit` calls its argument for every place to show.
  template <class Visit>
  void frame(const Visit& visit) {
    arena.execute([&] {
      tbb::parallel_for(std::size_t{0}, framing.size(), [&](std::size_t v) {
        visit([&, v](const std::array<double, 3>& p) {
          if (finite(p)) extents[v].add(framing[v], p);
        });
      });
    });
    fitted = false;
  }

  template <class DrawView>
  void draw(const DrawView& draw_view) {
    if (!fitted) fit_views(settings, framing, extents, views);
    fitted = true;
    for (const View& view : views) {
      if (context.cancelled()) throw Error(ExitCode::internal, "cancelled");
      arena.execute([&] { draw_view(view); });
    }
  }

  // So large that as many points, spread over the view, nearly touch; within reason.
  [[nodiscard]] double point_radius(const View& view) const {
    if (settings.point_radius > 0) return settings.point_radius;
    const Extent& extent = extents[static_cast<std::size_t>(&view - views.data())];
    const double area = extent.size(0) * extent.size(1) * view.scale * view.scale;
    const double spacing = std::sqrt(area / static_cast<double>(std::max<std::uint64_t>(framed, 1)));
    const double pixel = settings.supersample;
    return std::clamp(1.3 * spacing, 0.5 * pixel, 6 * pixel) / view.scale;
  }

  RenderSettings settings;
  RunContext context;
  Canvas canvas;
  std::vector<View> views;
  std::vector<View> framing;    ///< begins with `views` as they stand in the first frame
  std::vector<Extent> extents;  ///< one per framing view
  tbb::task_arena arena;
  std::uint64_t framed = 0;
  std::uint64_t boundary = 0;
  bool fitted = false;
};

Renderer::Renderer(const RenderSettings& settings, const RunContext& context)
    : impl_(std::make_unique<Impl>(settings, context)) {}

Renderer::~Renderer() = default;

void Renderer::frame(const TriangleMesh& mesh) {
  impl_->frame([&](const auto& add) { std::for_each(mesh.positions.begin(), mesh.positions.end(), add); });
  impl_->framed += mesh.positions.size();
}

void Renderer::frame(const SampleBatch& points) {
  impl_->frame([&](const auto& add) {
    for (std::size_t i = 0; i < points.size(); ++i) add(std::array{points.x[i], points.y[i], points.z[i]});
  });
  impl_->framed += points.size();
}

void Renderer::frame(const LevelSet& level_set) {
  impl_->frame([&](const auto& add) { visit_surface(level_set, add); });
}

void Renderer::frame(const FogVolume& fog) {
  impl_->frame([&](const auto& add) { visit_fog(fog, add); });
}

void Renderer::turn(int frame) {
  const RenderSettings& s = impl_->settings;
  if (frame < 0 || frame >= s.frames)
    throw Error(ExitCode::usage, fmt::format("cannot draw frame {}: there are {}", frame, s.frames));
  impl_->views = make_views(s, 360.0 * frame / s.frames);
  impl_->fitted = false;
  impl_->boundary = 0;
  impl_->canvas.clear();
}

void Renderer::draw(const TriangleMesh& mesh) {
  const auto largest = mesh.positions.size();
  for (const auto& t : mesh.triangles) {
    if (std::max({t[0], t[1], t[2]}) >= largest)
      throw Error(ExitCode::unreadable, "a triangle names a vertex that is not there");
  }
  const bool has_normals = mesh.normals.size() == mesh.positions.size();
  const auto computed = has_normals ? std::vector<std::array<float, 3>>{} : meshes::vertex_normals(mesh);
  const auto& normals = has_normals ? mesh.normals : computed;
  impl_->draw([&](const View& view) { draw_mesh(mesh, normals, impl_->settings, view, impl_->canvas); });
  if (!impl_->settings.mark_boundary) return;
  const std::vector<measure::Edge> edges = impl_->arena.execute([&] { return measure::boundary_edges(mesh); });
  impl_->boundary += edges.size();
  impl_->draw([&](const View& view) { draw_edges(mesh, edges, impl_->settings, view, impl_->canvas); });
}

void Renderer::draw(const SampleBatch& points, const AttributeLayout& layout) {
  impl_->draw([&](const View& view) {
    draw_points(points, layout, impl_->point_radius(view), impl_->settings, view, impl_->canvas);
  });
}

void Renderer::draw(const LevelSet& level_set) {
  impl_->draw([&](const View& view) { draw_level_set(level_set, impl_->settings, view, impl_->canvas); });
}

void Renderer::draw(const FogVolume& fog) {
  impl_->draw([&](const View& view) { draw_fog(fog, impl_->settings, view, impl_->canvas); });
}

std::uint64_t Renderer::boundary_edges() const {
  return impl_->boundary;
}

bool Renderer::blank() const {
  return impl_->canvas.blank();
}

Image Renderer::finish() const {
  return impl_->arena.execute([&] { return impl_->canvas.resolve(impl_->settings.supersample); });
}

Image render(const TriangleMesh& mesh, const RenderSettings& settings, const RunContext& context) {
  Renderer renderer(settings, context);
  renderer.frame(mesh);
  renderer.draw(mesh);
  return renderer.finish();
}

}  // namespace lamina

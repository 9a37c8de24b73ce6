#include <cmath>

#include "render/draw.h"
#include "render/raster.h"
#include "render/shade.h"

namespace lamina::render_detail {
namespace {

constexpr double kLeastRadius = 0.5;  // pixels: a point never vanishes between samples
constexpr float kLeastSlant = 0.05F;  // a disc seen from its side keeps this much of its width

// A point's disc on the canvas: its centre, its radius in samples, and how it leans.
struct Disc {
  Projected centre;
  double radius;
  Eigen::Vector3f normal;  ///< view's axes, facing the viewer
  bool back;
};

}  // namespace

void draw_points(const SampleBatch& points, const AttributeLayout& layout, double radius,
                 const RenderSettings& settings, const View& view, Canvas& canvas) {
  const auto colours =
      settings.colour == ColourMode::automatic ? ColourReader::find(layout, points.attributes) : std::nullopt;
  const bool oriented = points.nx.size() == points.size();
  const bool own_radius = settings.point_radius <= 0 && points.radius.size() == points.size();
  const auto disc_of = [&](std::size_t i) {
    Disc disc{view.project({points.x[i], points.y[i], points.z[i]}), radius, Eigen::Vector3f::UnitZ(), false};
    if (own_radius && points.radius[i] > 0) disc.radius = 0.5 * static_cast<double>(points.radius[i]);
    disc.radius = std::max(disc.radius * view.scale, kLeastRadius * settings.supersample);
    if (oriented) {
      const Eigen::Vector3f n = view.direction({points.nx[i], points.ny[i], points.nz[i]});
      const float length = n.norm();
      if (length > 0 && std::isfinite(length)) {
        disc.back = n.z() < 0;
        disc.normal = (disc.back ? -n : n) / length;
      }
    }
    return disc;
  };
  const auto rows_of = [&](std::size_t i) {
    const Disc disc = disc_of(i);
    const auto& c = disc.centre;
    if (!std::isfinite(c.x + c.y + c.depth) || !(c.depth <= view.near)) return Rows{};
    return clip_span(c.y - disc.radius, c.y + disc.radius, view.tile.y, view.tile.height);
  };
  draw_in_bands(points.size(), canvas.height(), rows_of, [&](std::size_t i, Rows rows) {
    const Disc disc = disc_of(i);
    const Rows columns =
        clip_span(disc.centre.x - disc.radius, disc.centre.x + disc.radius, view.tile.x, view.tile.width);
    Rgb base = colours ? (*colours)(i) : kClay;
    if (settings.colour == ColourMode::normals && oriented)
      base = normal_colour({points.nx[i], points.ny[i], points.nz[i]});
    const Rgb colour = lit(base, disc.normal, disc.back);
    const double slant = std::max(disc.normal.z(), kLeastSlant);
    for (int y = rows.first; y <= rows.last; ++y) {
      for (int x = columns.first; x <= columns.last; ++x) {
        const double dx = x + 0.5 - disc.centre.x, dy = disc.centre.y - (y + 0.5);
        const bool at_centre = std::abs(dx) <= 0.5 && std::abs(dy) <= 0.5;
        const double dz = -(disc.normal.x() * dx + disc.normal.y() * dy) / slant;
        if (!at_centre && dx * dx + dy * dy + dz * dz > disc.radius * disc.radius) continue;
        const float depth = disc.centre.depth + static_cast<float>((at_centre ? 0 : dz) / view.scale);
        if (canvas.visible(x, y, depth)) canvas.set(x, y, depth, colour);
      }
    }
  });
}

}  // namespace lamina::render_detail

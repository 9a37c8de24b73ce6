#include <tbb/parallel_for.h>
#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "meshes/vec3.h"
#include "render/canvas.h"

namespace lamina::render_detail {
namespace {

// Which samples a triangle, a disc or a line covers, and primitives shared out to horizontal bands of the canvas: bands
// run in parallel, and inside a band the primitives come in their own order, so that a picture does not depend on the
// number of threads.

/// Rows first to last, both included; none when last < first.
struct Rows {
  int first = 0, last = -1;
};

/// Calls draw(i, rows) for every primitive i < count and every band that meets rows_of(i), with the rows they share.
/// rows_of may reach beyond the canvas; both functions are called from several threads.
template <class RowsOf, class Draw>
void draw_in_bands(std::size_t count, int height, const RowsOf& rows_of, const Draw& draw) {
  constexpr int kBand = 32;                             // rows
  constexpr std::size_t kChunk = std::size_t{1} << 14;  // primitives sorted by one task
  constexpr std::size_t kBlock = kChunk * 64;           // primitives sorted before drawing: bounds the lists
  const auto bands = static_cast<std::size_t>((height + kBand - 1) / kBand);
  std::vector<std::vector<std::vector<std::uint32_t>>> lists(kBlock / kChunk);
  for (std::size_t block = 0; block < count; block += kBlock) {
    const std::size_t block_size = std::min(kBlock, count - block);
    const std::size_t chunks = (block_size + kChunk - 1) / kChunk;
    tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t chunk) {
      auto& of_band = lists[chunk];
      of_band.resize(bands);
      for (auto& list : of_band) list.clear();
      const std::size_t end = std::min(block_size, (chunk + 1) * kChunk);
      for (std::size_t i = chunk * kChunk; i < end; ++i) {
        Rows rows = rows_of(block + i);
        rows = {std::max(rows.first, 0), std::min(rows.last, height - 1)};
        if (rows.last < rows.first) continue;
        for (int b = rows.first / kBand; b <= rows.last / kBand; ++b) {
          of_band[static_cast<std::size_t>(b)].push_back(static_cast<std::uint32_t>(i));
        }
      }
    });
    tbb::parallel_for(std::size_t{0}, bands, [&](std::size_t band) {
      const int top = static_cast<int>(band) * kBand;
      const int bottom = std::min(top + kBand, height) - 1;
      for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
        for (const std::uint32_t i : lists[chunk][band]) {
          const Rows rows = rows_of(block + i);
          draw(block + i, Rows{std::max(rows.first, top), std::min(rows.last, bottom)});
        }
      }
    });
  }
}

/// Columns of a tile's rectangle that [low, high] meets, or rows with the other extent.
inline Rows clip_span(double low, double high, int begin, int size) {
  const double first = std::max<double>(begin, std::floor(low)),
               last = std::min<double>(begin + size - 1, std::floor(high));
  if (!(first <= last)) return {};
  return {static_cast<int>(first), static_cast<int>(last)};
}

/// A triangle ready for walking. Coordinates are snapped to 1/256 sample, which makes the edge functions exact: two
/// triangles sharing an edge leave no sample between them.
class TriangleSpan {
 public:
  TriangleSpan(const Projected& a, const Projected& b, const Projected& c) {
    const std::array<const Projected*, 3> corners{&a, &b, &c};
    for (std::size_t i = 0; i < 3; ++i) {
      x_[i] = std::round(static_cast<double>(corners[i]->x) * 256) / 256;
      y_[i] = std::round(static_cast<double>(corners[i]->y) * 256) / 256;
    }
    area_ = edge(0, 1, x_[2], y_[2]);
  }
  /// The picture's y points down: a counter-clockwise triangle seen from outside has a negative area here.
  [[nodiscard]] bool faces_viewer() const { return area_ < 0; }
  [[nodiscard]] bool empty() const { return !(std::abs(area_) > 0) || !std::isfinite(area_); }
  [[nodiscard]] Rows rows(const Tile& tile) const {
    return clip_span(std::min({y_[0], y_[1], y_[2]}), std::max({y_[0], y_[1], y_[2]}), tile.y, tile.height);
  }
  [[nodiscard]] Rows columns(const Tile& tile) const {
    return clip_span(std::min({x_[0], x_[1], x_[2]}), std::max({x_[0], x_[1], x_[2]}), tile.x, tile.width);
  }
  /// Barycentric weights at a sample's centre; false outside.
  [[nodiscard]] bool weights(int column, int row, std::array<float, 3>& w) const {
    const double px = column + 0.5, py = row + 0.5;
    const double e0 = edge(1, 2, px, py), e1 = edge(2, 0, px, py), e2 = edge(0, 1, px, py);
    if (area_ > 0 ? (e0 < 0 || e1 < 0 || e2 < 0) : (e0 > 0 || e1 > 0 || e2 > 0)) return false;
    w = {static_cast<float>(e0 / area_), static_cast<float>(e1 / area_), static_cast<float>(e2 / area_)};
    return true;
  }
  /// Distance in samples from a point of the triangle to its nearest side.
  [[nodiscard]] double side_distance(const std::array<float, 3>& w) const {
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t a = (i + 1) % 3, b = (i + 2) % 3;
      const double length = std::hypot(x_[b] - x_[a], y_[b] - y_[a]);
      nearest = std::min(nearest, std::abs(area_) * static_cast<double>(w[i]) / length);
    }
    return nearest;
  }

 private:
  [[nodiscard]] double edge(std::size_t a, std::size_t b, double px, double py) const {
    return (x_[b] - x_[a]) * (py - y_[a]) - (y_[b] - y_[a]) * (px - x_[a]);
  }
  std::array<double, 3> x_{}, y_{};
  double area_ = 0;  ///< twice the signed area
};

constexpr double kWireWidth = 0.45;      // half the width of a wire line, pixels
constexpr double kBoundaryWidth = 1.25;  // half the width of a boundary line, pixels
/// A vertex whose normal has a smaller cosine (35 degrees) with a triangle's lies on a sharp edge: the triangle is lit
/// by its own there, as smooth shading would carry the edge far into large triangles. Not one that lies across the
/// normals of all of its vertices (37 degrees from their mean), as noise leaves them: there is no edge.
constexpr float kSharpCorner = 0.82F;
constexpr float kAlongVertices = 0.8F;
constexpr float kWireDarkening = 0.25F;
constexpr double kLeastRadius = 0.5;  // pixels: a point never vanishes between samples
constexpr float kLeastSlant = 0.05F;  // a disc seen from its side keeps this much of its width

std::vector<Projected> project_all(const TriangleMesh& mesh, const View& view) {
  std::vector<Projected> projected(mesh.positions.size());
  tbb::parallel_for(std::size_t{0}, projected.size(),
                    [&](std::size_t i) { projected[i] = view.project(mesh.positions[i]); });
  return projected;
}

// How one triangle looks at any of its points.
class Surface {
 public:
  Surface(const TriangleMesh& mesh, const std::vector<std::array<float, 3>>& normals, const RenderSettings& settings,
          const std::optional<ColourReader>& colours, const View& view, std::size_t triangle)
      : settings_(settings) {
    const auto& t = mesh.triangles[triangle];
    face_ = view.direction(meshes::to_float(meshes::unit(meshes::area_normal(mesh, triangle))));
    back_ = face_.z() < 0;
    if (back_) face_ = -face_;
    Eigen::Vector3f mean = Eigen::Vector3f::Zero();
    for (std::size_t i = 0; i < 3; ++i) {
      normal_[i] = view.direction(normals[t[i]]);
      mean += normal_[i];
    }
    const bool along = std::abs(mean.dot(face_)) > kAlongVertices * mean.norm();
    for (std::size_t i = 0; i < 3; ++i) {
      const bool sharp = std::abs(normal_[i].dot(face_)) < kSharpCorner * normal_[i].norm();
      if (along && sharp) normal_[i] = mean.dot(face_) < 0 ? -face_ : face_;
      if (settings.colour == ColourMode::normals) {
        base_[i] = normal_colour(normals[t[i]]);
      } else {
        base_[i] = colours ? (*colours)(t[i]) : kClay;
      }
    }
  }
  [[nodiscard]] Rgb at(const std::array<float, 3>& w) const {
    Rgb base{};
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t c = 0; c < 3; ++c) base[c] += w[i] * base_[i][c];
      normal += w[i] * normal_[i];
    }
    const float length = normal.norm();
    if (settings_.flat || !(length > 0)) {
      normal = face_;
    } else {
      normal *= (normal.dot(face_) < 0 ? -1 : 1) / length;
    }
    return lit(base, normal, back_);
  }

 private:
  const RenderSettings& settings_;
  Eigen::Vector3f face_;  ///< toward the viewer
  std::array<Eigen::Vector3f, 3> normal_;
  std::array<Rgb, 3> base_;
  bool back_ = false;
};

// Squared distance from a point to a segment, in samples.
double segment_distance2(const Projected& a, const Projected& b, double px, double py) {
  const double dx = static_cast<double>(b.x) - a.x, dy = static_cast<double>(b.y) - a.y;
  const double length2 = dx * dx + dy * dy;
  const double along = length2 > 0 ? std::clamp(((px - a.x) * dx + (py - a.y) * dy) / length2, 0.0, 1.0) : 0.0;
  const double ex = a.x + along * dx - px, ey = a.y + along * dy - py;
  return ex * ex + ey * ey;
}

// A point's disc on the canvas: its centre, its radius in samples, and how it leans.
struct Disc {
  Projected centre;
  double radius;
  Eigen::Vector3f normal;  ///< view's axes, facing the viewer
  bool back;
};

}  // namespace

void draw_mesh(const TriangleMesh& mesh, const std::vector<std::array<float, 3>>& normals,
               const RenderSettings& settings, const View& view, Canvas& canvas) {
  const std::vector<Projected> projected = project_all(mesh, view);
  const auto colours =
      settings.colour == ColourMode::automatic ? ColourReader::find(mesh.layout, mesh.attributes) : std::nullopt;
  const double wire = kWireWidth * settings.supersample;
  const auto span = [&](std::size_t i) {
    const auto& t = mesh.triangles[i];
    return TriangleSpan(projected[t[0]], projected[t[1]], projected[t[2]]);
  };
  const auto rows_of = [&](std::size_t i) {
    const TriangleSpan triangle = span(i);
    return triangle.empty() ? Rows{} : triangle.rows(view.tile);
  };
  draw_in_bands(mesh.triangles.size(), canvas.height(), rows_of, [&](std::size_t i, Rows rows) {
    const TriangleSpan triangle = span(i);
    const Rows columns = triangle.columns(view.tile);
    const auto& t = mesh.triangles[i];
    std::optional<Surface> surface;
    for (int y = rows.first; y <= rows.last; ++y) {
      for (int x = columns.first; x <= columns.last; ++x) {
        std::array<float, 3> w{};
        if (!triangle.weights(x, y, w)) continue;
        const float depth = w[0] * projected[t[0]].depth + w[1] * projected[t[1]].depth + w[2] * projected[t[2]].depth;
        if (!(depth <= view.near) || !canvas.visible(x, y, depth)) continue;
        if (!surface) surface.emplace(mesh, normals, settings, colours, view, i);
        Rgb colour = surface->at(w);
        if (settings.wire && triangle.side_distance(w) < wire) {
          for (float& c : colour) c *= kWireDarkening;
        }
        canvas.set(x, y, depth, colour);
      }
    }
  });
}

void draw_edges(const TriangleMesh& mesh, const std::vector<measure::Edge>& edges, const RenderSettings& settings,
                const View& view, Canvas& canvas) {
  const double half_width = kBoundaryWidth * settings.supersample;
  struct Ends {
    Projected a, b;
    bool shown;
  };
  const auto ends = [&](std::size_t i) {
    const Projected a = view.project(mesh.positions[edges[i][0]]), b = view.project(mesh.positions[edges[i][1]]);
    const bool finite = std::isfinite(a.x + a.y + a.depth + b.x + b.y + b.depth);
    return Ends{a, b, finite && std::min(a.depth, b.depth) <= view.near};
  };
  const auto rows_of = [&](std::size_t i) {
    const auto [a, b, shown] = ends(i);
    if (!shown) return Rows{};
    return clip_span(std::min(a.y, b.y) - half_width, std::max(a.y, b.y) + half_width, view.tile.y, view.tile.height);
  };
  draw_in_bands(edges.size(), canvas.height(), rows_of, [&](std::size_t i, Rows rows) {
    const auto [a, b, shown] = ends(i);
    const Rows columns =
        clip_span(std::min(a.x, b.x) - half_width, std::max(a.x, b.x) + half_width, view.tile.x, view.tile.width);
    for (int y = rows.first; y <= rows.last; ++y) {
      for (int x = columns.first; x <= columns.last; ++x) {
        if (segment_distance2(a, b, x + 0.5, y + 0.5) > half_width * half_width) continue;
        canvas.set(x, y, Canvas::kOverEverything, kBoundary);
      }
    }
  });
}

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

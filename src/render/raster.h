// Which samples a triangle, a disc or a line covers, and primitives shared out to horizontal bands of the canvas: bands
// run in parallel, and inside a band the primitives come in their own order, so that a picture does not depend on the
// number of threads.
#pragma once
#include <tbb/parallel_for.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "render/view.h"

namespace lamina::render_detail {

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

}  // namespace lamina::render_detail

#include "normals/window_samples.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace lamina::normals {

void WindowSamples::clear() {
  for (auto* v : {&x, &y, &z}) v->clear();
  for (auto* v : {&nx, &ny, &nz}) v->clear();
  row.clear();
  node.clear();
  given.clear();
}

void WindowSamples::append(const WindowSamples& from, std::size_t i) {
  x.push_back(from.x[i]);
  y.push_back(from.y[i]);
  z.push_back(from.z[i]);
  nx.push_back(from.nx[i]);
  ny.push_back(from.ny[i]);
  nz.push_back(from.nz[i]);
  row.push_back(from.row[i]);
  node.push_back(from.node[i]);
  given.push_back(from.given[i]);
}

void WindowSamples::gather(const WindowSamples& from, std::span<const std::uint32_t> order) {
  const auto move = [&](const auto& source, auto& target) {
    target.resize(order.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, order.size(), std::size_t{1} << 14), [&](const auto& range) {
      for (std::size_t i = range.begin(); i < range.end(); ++i) target[i] = source[order[i]];
    });
  };
  move(from.x, x);
  move(from.y, y);
  move(from.z, z);
  move(from.nx, nx);
  move(from.ny, ny);
  move(from.nz, nz);
  move(from.row, row);
  move(from.node, node);
  move(from.given, given);
}

float agreement(const std::array<float, 3>& d, const std::array<float, 3>& a, const std::array<float, 3>& b,
                float scale) {
  constexpr float kNoise = 0.25F;  // offsets of half the neighbourhood's radius are mirrored by half
  const float along_a = a[0] * d[0] + a[1] * d[1] + a[2] * d[2];
  const float along_b = b[0] * d[0] + b[1] * d[1] + b[2] * d[2];
  const float cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const float squared = d[0] * d[0] + d[1] * d[1] + d[2] * d[2] + kNoise * scale;
  return squared > 0 ? cosine - 2 * along_a * along_b / squared : cosine;
}

}  // namespace lamina::normals

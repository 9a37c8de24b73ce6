#include "lamina/render.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "base/with_threads.h"
#include "lamina/error.h"
#include "measure/triangle_bvh.h"

namespace lamina {
namespace {

using Colour = std::array<double, 3>;

constexpr std::array<Colour, 5> kRamp{{{38, 52, 140}, {36, 150, 178}, {176, 208, 92}, {244, 158, 46}, {168, 20, 38}}};
constexpr std::array<std::uint8_t, 3> kUnknown{128, 128, 128};

}  // namespace

std::vector<double> vertex_distances(const TriangleMesh& mesh, const TriangleMesh& truth, const RunContext& run) {
  if (truth.triangles.empty()) throw Error(ExitCode::unreadable, "the truth to measure from must be a mesh with faces");
  std::vector<double> distances(mesh.positions.size());
  with_threads(run.threads, [&] {
    const measure::TriangleBvh tree(truth);
    tbb::parallel_for(std::size_t{0}, distances.size(), [&](std::size_t i) {
      if (run.cancelled()) return;
      const auto& p = mesh.positions[i];
      const bool finite = std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
      distances[i] = finite ? tree.distance(p) : std::numeric_limits<double>::quiet_NaN();
    });
  });
  if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
  return distances;
}

PaintRange paint_range(std::vector<double> values) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  if (values.empty()) return {0, 0};
  std::sort(values.begin(), values.end());
  const auto n = static_cast<double>(values.size());
  return {std::min(values.front(), 0.0), values[static_cast<std::size_t>(std::ceil(0.99 * n)) - 1]};
}

std::array<std::uint8_t, 3> paint_colour(double value, const PaintRange& range) {
  if (!std::isfinite(value)) return kUnknown;
  const double width = range.high - range.low;
  const double place = width > 0 ? std::clamp((value - range.low) / width, 0.0, 1.0) : (value > range.low ? 1.0 : 0.0);
  const double step = place * (kRamp.size() - 1);
  const auto below = std::min(static_cast<std::size_t>(step), kRamp.size() - 2);
  const double share = step - static_cast<double>(below);
  std::array<std::uint8_t, 3> out{};
  for (std::size_t c = 0; c < 3; ++c)
    out[c] = static_cast<std::uint8_t>(std::lround((1 - share) * kRamp[below][c] + share * kRamp[below + 1][c]));
  return out;
}

void paint(TriangleMesh& mesh, const std::vector<double>& values, const PaintRange& range) {
  if (values.size() != mesh.positions.size())
    throw Error(ExitCode::internal, "painting wants one value for every vertex");
  static constexpr std::array<const char*, 3> kNames{"red", "green", "blue"};
  for (std::size_t c = 0; c < 3; ++c) {
    std::size_t a = 0;
    while (a < mesh.layout.size() && mesh.layout[a].name != kNames[c]) ++a;
    if (a == mesh.layout.size()) {
      mesh.layout.emplace_back();
      mesh.attributes.emplace_back();
    }
    mesh.layout[a] = {kNames[c], ScalarType::uint8};
    mesh.attributes[a].resize(values.size());
    for (std::size_t i = 0; i < values.size(); ++i) mesh.attributes[a][i] = paint_colour(values[i], range)[c];
  }
}

}  // namespace lamina

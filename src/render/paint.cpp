#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/run.h"
#include "lamina/error.h"
#include "lamina/render.h"
#include "measure/triangle_bvh.h"
#include "meshes/vec3.h"

namespace lamina {
namespace {

using Colour = std::array<double, 3>;

constexpr std::array<Colour, 5> kRamp{{{38, 52, 140}, {36, 150, 178}, {176, 208, 92}, {244, 158, 46}, {168, 20, 38}}};
constexpr std::array<std::uint8_t, 3> kUnknown{128, 128, 128};

void require_faces(const TriangleMesh& truth) {
  if (truth.triangles.empty()) throw Error(ExitCode::unreadable, "the truth to measure from must be a mesh with faces");
}

/// Of the places at(0) ... at(count - 1); NaN for those that are not finite.
template <class At>
std::vector<double> distances(const measure::TriangleBvh& tree, std::size_t count, const At& at,
                              const RunContext& run) {
  std::vector<double> out(count);
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
    if (run.cancelled()) return;
    const meshes::Vec3 p = at(i);
    const bool finite = std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
    out[i] = finite ? tree.distance(p) : std::numeric_limits<double>::quiet_NaN();
  });
  if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
  return out;
}

}  // namespace

std::vector<double> vertex_distances(const TriangleMesh& mesh, const TriangleMesh& truth, const RunContext& run) {
  require_faces(truth);
  const auto at = [&](std::size_t i) { return mesh.positions[i]; };
  std::vector<double> out;
  with_threads(run.threads, [&] { out = distances(measure::TriangleBvh(truth), mesh.positions.size(), at, run); });
  return out;
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

struct DistanceField::Impl {
  TriangleMesh truth;
  measure::TriangleBvh tree;
  explicit Impl(TriangleMesh mesh) : truth(std::move(mesh)), tree(truth) {}
};

DistanceField::DistanceField(TriangleMesh truth) {
  require_faces(truth);
  impl_ = std::make_unique<Impl>(std::move(truth));
}
DistanceField::~DistanceField() = default;

std::vector<double> DistanceField::of(const SampleBatch& points, const RunContext& run) const {
  const auto at = [&](std::size_t i) { return meshes::Vec3{points.x[i], points.y[i], points.z[i]}; };
  std::vector<double> out;
  with_threads(run.threads, [&] { out = distances(impl_->tree, points.size(), at, run); });
  return out;
}

std::vector<double> point_values(const SampleBatch& points, const AttributeLayout& layout, const std::string& name) {
  const auto doubles = [](const std::vector<float>& v) { return std::vector<double>(v.begin(), v.end()); };
  if (const auto a = find_attribute(layout, name)) return doubles(points.attributes[*a]);
  if (name == "radius" || name == "pscale") return doubles(points.radius);
  if (name == "quality" || name == "confidence") return doubles(points.quality);
  return {};
}

void paint(SampleBatch& points, AttributeLayout& layout, const std::vector<double>& values, const PaintRange& range) {
  if (values.size() != points.size()) throw Error(ExitCode::internal, "painting wants one value for every point");
  layout = {{"red", ScalarType::uint8}, {"green", ScalarType::uint8}, {"blue", ScalarType::uint8}};
  points.attributes.assign(3, std::vector<float>(values.size()));
  points.exact.clear();
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto colour = paint_colour(values[i], range);
    for (std::size_t c = 0; c < 3; ++c) points.attributes[c][i] = colour[c];
  }
}

void PaintScale::add(const std::vector<double>& values) {
  constexpr std::size_t kMost = std::size_t{1} << 20;
  for (const double v : values) {
    const bool wanted = seen_++ % stride_ == 0;
    if (!std::isfinite(v)) continue;
    least_ = std::min(least_, v);
    most_ = std::max(most_, v);
    if (!wanted) continue;
    kept_.push_back(v);
    if (kept_.size() < kMost) continue;
    // Every second of those kept is enough from now on.
    for (std::size_t i = 0; 2 * i < kept_.size(); ++i) kept_[i] = kept_[2 * i];
    kept_.resize(kept_.size() / 2);
    stride_ *= 2;
  }
}

PaintRange PaintScale::range() const {
  PaintRange range = paint_range(kept_);
  if (!kept_.empty()) range.low = std::min(least_, 0.0);
  return range;
}

}  // namespace lamina

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/with_threads.h"
#include "lamina/error.h"
#include "lamina/render.h"
#include "measure/triangle_bvh.h"

namespace lamina {

struct DistanceField::Impl {
  TriangleMesh truth;
  measure::TriangleBvh tree;
  explicit Impl(TriangleMesh mesh) : truth(std::move(mesh)), tree(truth) {}
};

DistanceField::DistanceField(TriangleMesh truth) {
  if (truth.triangles.empty()) throw Error(ExitCode::unreadable, "the truth to measure from must be a mesh with faces");
  impl_ = std::make_unique<Impl>(std::move(truth));
}
DistanceField::~DistanceField() = default;

std::vector<double> DistanceField::of(const SampleBatch& points, const RunContext& run) const {
  std::vector<double> distances(points.size());
  with_threads(run.threads, [&] {
    tbb::parallel_for(std::size_t{0}, distances.size(), [&](std::size_t i) {
      const meshes::Vec3 p{points.x[i], points.y[i], points.z[i]};
      const bool finite = std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
      distances[i] = finite ? impl_->tree.distance(p) : std::numeric_limits<double>::quiet_NaN();
    });
  });
  return distances;
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

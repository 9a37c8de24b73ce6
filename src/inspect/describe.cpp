#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "edit/batch_pipe.h"
#include "lamina/edit.h"
#include "lamina/info.h"

namespace lamina {
namespace {

/// The range of a column, piece by piece.
class RangeOf {
 public:
  RangeOf(std::string name, ScalarType type) : range_{std::move(name), type} {}

  template <class T>
  void add(T value) {
    if (!std::isfinite(value)) {
      ++range_.not_finite;
      return;
    }
    const auto v = static_cast<double>(value);
    if (range_.values++ == 0) range_.low = range_.high = first_ = v;
    range_.low = std::min(range_.low, v);
    range_.high = std::max(range_.high, v);
    sum_ += v - first_;  // about the first value: georeferenced coordinates keep their digits
  }
  template <class T>
  void add_all(const std::vector<T>& values) {
    for (const T value : values) add(value);
  }
  [[nodiscard]] ColumnRange result() const {
    ColumnRange out = range_;
    if (out.values > 0) {
      out.mean = std::clamp(first_ + sum_ / static_cast<double>(out.values), out.low, out.high);
    }
    return out;
  }

 private:
  ColumnRange range_;
  double first_ = 0, sum_ = 0;
};

/// Radii above 0 by half octaves.
class RadiusBins {
 public:
  void add(float radius) {
    if (radius > 0 && std::isfinite(radius)) ++bins_[static_cast<int>(std::floor(2 * std::log2(double{radius})))];
  }
  [[nodiscard]] std::vector<HistogramBin> result() const {
    std::vector<HistogramBin> out;
    if (bins_.empty()) return out;
    for (int b = bins_.begin()->first; b <= bins_.rbegin()->first; ++b) {
      const auto at = bins_.find(b);
      out.push_back({std::exp2(0.5 * b), std::exp2(0.5 * (b + 1)), at == bins_.end() ? 0 : at->second});
    }
    return out;
  }

 private:
  std::map<int, std::uint64_t> bins_;
};

std::vector<ColumnRange> results(const std::vector<RangeOf>& ranges) {
  std::vector<ColumnRange> out;
  out.reserve(ranges.size());
  for (const RangeOf& range : ranges) out.push_back(range.result());
  return out;
}

/// The box, from the ranges of x y z, which come first.
template <class Info>
void set_box(Info& info) {
  for (std::size_t k = 0; k < 3; ++k) {
    info.low[k] = info.columns[k].low;
    info.high[k] = info.columns[k].high;
  }
}

}  // namespace

PointsInfo describe_points(PointSource& source, const RunContext& run) {
  const PointSourceInfo& has = source.info();
  PointsInfo info;
  info.count = has.count;
  info.double_precision = has.double_precision;
  info.crs = has.crs;
  const ScalarType position = has.double_precision ? ScalarType::float64 : ScalarType::float32;
  std::vector<RangeOf> ranges;
  for (const char* axis : {"x", "y", "z"}) ranges.emplace_back(axis, position);
  if (has.has_normals)
    for (const char* axis : {"nx", "ny", "nz"}) ranges.emplace_back(axis, ScalarType::float32);
  if (has.has_radius) ranges.emplace_back(has.radius_name, ScalarType::float32);
  if (has.has_quality) ranges.emplace_back(has.quality_name, ScalarType::float32);
  for (const AttributeSpec& spec : has.attributes) ranges.emplace_back(spec.name, spec.type);

  RadiusBins radii;
  RangeOf lengths("length", ScalarType::float32);
  edit::for_each_batch(
      source, "read", run, [](SampleBatch&) {},
      [&](const SampleBatch& b) {
        auto range = ranges.begin();
        const auto look = [&](const auto& column, bool there) {
          if (there) (range++)->add_all(column);
        };
        for (const auto* axis : {&b.x, &b.y, &b.z}) look(*axis, true);
        for (const auto* axis : {&b.nx, &b.ny, &b.nz}) look(*axis, has.has_normals);
        look(b.radius, has.has_radius);
        look(b.quality, has.has_quality);
        for (std::size_t a = 0; a < has.attributes.size(); ++a) {
          if (a < b.exact.size() && !b.exact[a].empty()) {
            look(b.exact[a], true);
          } else {
            look(b.attributes[a], true);
          }
        }
        for (std::size_t i = 0; i < b.nx.size(); ++i) lengths.add(std::hypot(b.nx[i], b.ny[i], b.nz[i]));
        for (const float r : b.radius) radii.add(r);
        for (std::size_t i = 0; i < b.size(); ++i) info.bad_rows += is_finite_row(b, i) ? 0 : 1;
      });
  info.columns = results(ranges);
  set_box(info);
  info.normal_length_low = lengths.result().low;
  info.normal_length_high = lengths.result().high;
  info.radii = radii.result();
  return info;
}

MeshInfo describe_mesh(const TriangleMesh& mesh) {
  MeshInfo info;
  info.vertices = mesh.positions.size();
  info.triangles = mesh.triangles.size();
  std::vector<RangeOf> ranges;
  for (const char* axis : {"x", "y", "z"}) ranges.emplace_back(axis, ScalarType::float64);
  if (!mesh.normals.empty())
    for (const char* axis : {"nx", "ny", "nz"}) ranges.emplace_back(axis, ScalarType::float32);
  for (const AttributeSpec& spec : mesh.layout) ranges.emplace_back(spec.name, spec.type);
  for (const auto& p : mesh.positions)
    for (std::size_t k = 0; k < 3; ++k) ranges[k].add(p[k]);
  for (const auto& n : mesh.normals)
    for (std::size_t k = 0; k < 3; ++k) ranges[3 + k].add(n[k]);
  const std::size_t first = mesh.normals.empty() ? 3 : 6;
  for (std::size_t a = 0; a < mesh.attributes.size(); ++a) ranges[first + a].add_all(mesh.attributes[a]);
  info.columns = results(ranges);
  set_box(info);
  return info;
}

}  // namespace lamina

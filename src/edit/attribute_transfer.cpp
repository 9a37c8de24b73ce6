#include "lamina/edit.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "base/run.h"
#include "edit/point_tree.h"
#include "edit/rows.h"
#include "lamina/error.h"

namespace lamina {
namespace {

constexpr float kRadii = 2;  // R over the points' own radii: some twelve points and more

/// The points' attributes that are wanted.
std::vector<std::size_t> wanted_attributes(const PointSourceInfo& info, const std::vector<std::string>& names) {
  std::vector<std::size_t> wanted;
  std::vector<std::string> known;
  for (const AttributeSpec& spec : info.attributes) known.push_back(spec.name);
  if (known.empty())
    throw Error(ExitCode::usage, fmt::format("{}: the points have no attributes to transfer", info.path));
  for (std::size_t a = 0; names.empty() && a < known.size(); ++a) wanted.push_back(a);
  for (const std::string& name : names) {
    const auto at = std::find(known.begin(), known.end(), name);
    if (at == known.end()) {
      throw Error(ExitCode::usage, fmt::format("{}: the points have no attribute '{}'; they have {}", info.path, name,
                                               fmt::join(known, ", ")));
    }
    wanted.push_back(static_cast<std::size_t>(at - known.begin()));
  }
  return wanted;
}

/// Points held in memory.
struct Portion {
  std::vector<std::array<double, 3>> positions;
  std::vector<float> radius;
  std::vector<std::vector<float>> values;  ///< per wanted attribute

  void add(const SampleBatch& b, const std::vector<std::size_t>& wanted) {
    for (std::size_t i = 0; i < b.size(); ++i) {
      const bool usable = std::isfinite(b.x[i]) && std::isfinite(b.y[i]) && std::isfinite(b.z[i]) &&
                          (b.radius.empty() || std::isfinite(b.radius[i]));
      if (!usable) continue;
      positions.push_back({b.x[i], b.y[i], b.z[i]});
      if (!b.radius.empty()) radius.push_back(b.radius[i]);
      for (std::size_t a = 0; a < wanted.size(); ++a) {
        const float value = b.attributes[wanted[a]][i];
        values[a].push_back(std::isfinite(value) ? value : 0.0F);
      }
    }
  }
  void clear() {
    positions.clear();
    radius.clear();
    for (auto& column : values) column.clear();
  }
};

/// What the vertices have been given so far.
class Receivers {
 public:
  Receivers(const TriangleMesh& mesh, const TransferSettings& settings, std::size_t attributes)
      : mesh_(mesh), settings_(settings), nearest_(mesh.positions.size(), first_bound()) {
    values_.assign(attributes, std::vector<float>(mesh.positions.size()));
    if (settings.mode == TransferMode::nearest) return;
    weights_.assign(mesh.positions.size(), 0);
    sums_.assign(attributes, std::vector<double>(mesh.positions.size()));
  }

  void take(const Portion& portion) {
    if (portion.positions.empty()) return;
    const edit::PointTree tree(portion.positions);
    const float largest =
        portion.radius.empty() ? 0.0F : *std::max_element(portion.radius.begin(), portion.radius.end());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, nearest_.size(), 1024), [&](const auto& range) {
      for (std::size_t v = range.begin(); v < range.end(); ++v) {
        take_nearest(v, tree, portion);
        if (!weights_.empty()) take_weighted(v, tree, portion, largest);
      }
    });
  }

  /// The attribute's value at a vertex, if a point reached it.
  [[nodiscard]] std::optional<float> value(std::size_t attribute, std::size_t v) const {
    if (!weights_.empty() && weights_[v] > 0) return static_cast<float>(sums_[attribute][v] / weights_[v]);
    if (nearest_[v] < first_bound()) return values_[attribute][v];
    return std::nullopt;
  }

 private:
  [[nodiscard]] double first_bound() const {
    if (settings_.distance == 0 || settings_.mode == TransferMode::weighted)
      return std::numeric_limits<double>::infinity();
    // A point exactly that far still counts.
    return std::nextafter(settings_.distance * settings_.distance, std::numeric_limits<double>::infinity());
  }

  /// Earlier portions win where points are equally near: a later one must be nearer.
  void take_nearest(std::size_t v, const edit::PointTree& tree, const Portion& portion) {
    const edit::NearestPoint found = tree.nearest(mesh_.positions[v], nearest_[v]);
    if (!(found.squared_distance < nearest_[v])) return;
    nearest_[v] = found.squared_distance;
    for (std::size_t a = 0; a < values_.size(); ++a) values_[a][v] = portion.values[a][found.point];
  }

  void take_weighted(std::size_t v, const edit::PointTree& tree, const Portion& portion, float largest) {
    const double reach = settings_.distance > 0 ? settings_.distance : double{kRadii * largest};
    tree.within(mesh_.positions[v], reach * reach, [&](std::uint32_t i, double d2) {
      const double r = settings_.distance > 0 ? settings_.distance : double{kRadii * portion.radius[i]};
      const double t = 1 - d2 / (r * r);
      if (!(t > 0)) return;
      const double weight = t * t * t * t;
      weights_[v] += weight;
      for (std::size_t a = 0; a < sums_.size(); ++a) sums_[a][v] += weight * double{portion.values[a][i]};
    });
  }

  const TriangleMesh& mesh_;
  TransferSettings settings_;
  std::vector<double> nearest_;             ///< squared distance
  std::vector<std::vector<float>> values_;  ///< of the nearest point
  std::vector<double> weights_;             ///< weighted mode
  std::vector<std::vector<double>> sums_;
};

std::vector<float>& column_of(TriangleMesh& mesh, const AttributeSpec& spec) {
  for (std::size_t a = 0; a < mesh.layout.size(); ++a) {
    if (mesh.layout[a].name != spec.name) continue;
    mesh.layout[a].type = spec.type;
    return mesh.attributes[a];
  }
  mesh.layout.push_back(spec);
  return mesh.attributes.emplace_back(mesh.positions.size());
}

TransferReport transfer(PointSource& points, TriangleMesh& mesh, const TransferSettings& settings,
                        const RunContext& run) {
  const PointSourceInfo& info = points.info();
  const std::vector<std::size_t> wanted = wanted_attributes(info, settings.attributes);
  TransferReport report;
  Receivers receivers(mesh, settings, wanted.size());
  Portion portion;
  portion.values.resize(wanted.size());
  const auto hand_over = [&] {
    report.points += portion.positions.size();
    receivers.take(portion);
    portion.clear();
  };
  edit::for_each_batch(
      points, "transfer", run, [](SampleBatch&) {},
      [&](const SampleBatch& batch) {
        if (portion.positions.size() + batch.size() > settings.points_at_once) hand_over();
        portion.add(batch, wanted);
      });
  hand_over();
  if (report.points == 0) throw Error(ExitCode::empty, fmt::format("{}: holds no usable points", info.path));
  for (std::size_t a = 0; a < wanted.size(); ++a) {
    std::vector<float>& column = column_of(mesh, info.attributes[wanted[a]]);
    for (std::size_t v = 0; v < column.size(); ++v) {
      const auto value = receivers.value(a, v);
      if (value) column[v] = *value;
      report.unreachable += a == 0 && !value ? 1 : 0;
    }
  }
  return report;
}

}  // namespace

TransferReport transfer_attributes(PointSource& points, TriangleMesh& mesh, const TransferSettings& settings,
                                   const RunContext& run) {
  if (!(settings.distance >= 0) || !std::isfinite(settings.distance))
    throw Error(ExitCode::usage, "attribtransfer: --distance must be 0 (no limit) or positive");
  if (settings.mode == TransferMode::weighted && settings.distance == 0 && !points.info().has_radius) {
    throw Error(ExitCode::usage, fmt::format("{}: the points have no radii to weigh by: give --distance, or make radii "
                                             "with 'lamina radius' first",
                                             points.info().path));
  }
  TransferReport report;
  with_threads(run.threads, [&] { report = transfer(points, mesh, settings, run); });
  return report;
}

}  // namespace lamina

#include "lamina/scatter.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/hashing.h"
#include "base/output_file.h"
#include "base/run.h"
#include "lamina/error.h"
#include "measure/triangle_bvh.h"
#include "meshes/vec3.h"
#include "scatter/point_rows.h"
#include "scatter/shapes.h"

namespace lamina {
namespace {

constexpr std::uint64_t kChunk = 1u << 15;
constexpr std::uint64_t kNoiseStream = 0x6E6F697365ull, kThinningStream = 0x7468696Eull;

/// The density in units of the densest part: falls exponentially along the box's longest axis from 1 to 1 / ratio.
class Density {
 public:
  Density(const Surface& surface, double ratio) : log_ratio_(std::log(ratio)) {
    const auto box = surface.box();
    for (std::size_t k = 1; k < 3; ++k)
      if (box.high[k] - box.low[k] > box.high[axis_] - box.low[axis_]) axis_ = k;
    low_ = box.low[axis_];
    extent_ = box.high[axis_] - low_;
  }
  [[nodiscard]] bool uniform() const { return log_ratio_ == 0; }
  [[nodiscard]] double at(const std::array<double, 3>& p) const {
    if (uniform() || !(extent_ > 0)) return 1;
    return std::exp(-log_ratio_ * std::clamp((p[axis_] - low_) / extent_, 0.0, 1.0));
  }
  /// Mean over the surface, by Monte Carlo: within about a percent.
  [[nodiscard]] double mean(const Surface& surface, std::uint64_t seed) const {
    if (uniform()) return 1;
    constexpr std::uint64_t kProbes = 1u << 16;
    double sum = 0;
    for (std::uint64_t i = 0; i < kProbes; ++i) sum += at(surface.point(~seed, i, 0).position);
    return sum / static_cast<double>(kProbes);
  }

 private:
  double log_ratio_, low_ = 0, extent_ = 0;
  std::size_t axis_ = 0;
};

class Sampler {
 public:
  Sampler(const Surface& surface, const ScatterSettings& settings)
      : surface_(surface), settings_(settings), density_(surface, settings.density_ratio) {
    const double densest =
        static_cast<double>(settings.count) / (surface.area() * density_.mean(surface, settings.seed));
    finest_spacing_ = 1 / std::sqrt(densest);
  }
  /// Sample i, in its place among those that are kept.
  [[nodiscard]] Surface::Point at(std::uint64_t i) const {
    if (density_.uniform()) return moved(surface_.point(settings_.seed, i, 0), i, 1);
    CounterRng thinning(settings_.seed ^ kThinningStream, i);
    for (std::uint32_t attempt = 0;; ++attempt) {
      const Surface::Point p = surface_.point(settings_.seed, i, attempt);
      const double density = density_.at(p.position);
      if (thinning.uniform() < density) return moved(p, i, density);
    }
  }

 private:
  [[nodiscard]] Surface::Point moved(Surface::Point p, std::uint64_t i, double density) const {
    if (settings_.noise == 0) return p;
    CounterRng rng(settings_.seed ^ kNoiseStream, i);
    const double reach = 0.5 * settings_.noise * finest_spacing_ / std::sqrt(density);
    for (double& c : p.position) c += reach * rng.symmetric();
    return p;
  }

  const Surface& surface_;
  const ScatterSettings& settings_;
  Density density_;
  double finest_spacing_ = 0;
};

void require_sane(const ScatterSettings& s) {
  if (s.count == 0) throw Error(ExitCode::usage, "scatter: --count must be at least 1");
  if (!(s.noise >= 0) || !std::isfinite(s.noise))
    throw Error(ExitCode::usage, fmt::format("scatter: --noise {} must be 0 or more", s.noise));
  if (!(s.density_ratio >= 1) || s.density_ratio > 1e6)
    throw Error(ExitCode::usage,
                fmt::format("scatter: --density-ratio {} must lie between 1 and 1000000", s.density_ratio));
}

}  // namespace

ScatterReport scatter(const Surface& surface, const ScatterSettings& settings, const std::string& path,
                      const RunContext& run) {
  require_sane(settings);
  const Sampler sampler(surface, settings);
  const scatter_detail::RowLayout layout{settings.double_positions, settings.colours && surface.has_colour(), false};
  ResultFile out(path);
  out.write(scatter_detail::ply_header(layout, settings.count));

  std::uint64_t next = 0;
  const auto first_of_chunk = [&](tbb::flow_control& control) {
    const std::uint64_t first = next;
    if (first >= settings.count || run.cancelled()) control.stop();
    next += kChunk;
    return first;
  };
  const auto make = [&](std::uint64_t first) {
    scatter_detail::RowPacker rows(layout);
    rows.reserve(kChunk);
    for (std::uint64_t i = first; i < std::min(first + kChunk, settings.count); ++i) {
      const Surface::Point p = sampler.at(i);
      rows.add(p.position, p.normal, p.colour);
    }
    return rows;
  };
  const auto write = [&](const scatter_detail::RowPacker& rows) { out.write(rows.bytes()); };
  with_threads(run.threads, [&] {
    const auto in_flight = static_cast<std::size_t>(2 * tbb::this_task_arena::max_concurrency());
    tbb::parallel_pipeline(
        in_flight, tbb::make_filter<void, std::uint64_t>(tbb::filter_mode::serial_in_order, first_of_chunk) &
                       tbb::make_filter<std::uint64_t, scatter_detail::RowPacker>(tbb::filter_mode::parallel, make) &
                       tbb::make_filter<scatter_detail::RowPacker, void>(tbb::filter_mode::serial_in_order, write));
  });
  if (run.cancelled()) throw Error(ExitCode::internal, "scatter: cancelled");
  out.commit();
  return {surface.area(), std::sqrt(surface.area() / static_cast<double>(settings.count))};
}

namespace {

using namespace meshes;

/// A direction to the scanner and the axes of its image.
struct View {
  Vec3 towards, right, up;
};

/// Directions on a Fibonacci lattice: even over the sphere for any number of views.
View view_number(int i, int views) {
  constexpr double kGoldenTurn = 0.61803398874989484820;
  const double z = 1 - (2 * i + 1) / static_cast<double>(views);
  const auto [s, c] = scatter_detail::sincos_turns(i * kGoldenTurn);
  const double across = std::sqrt(1 - z * z);
  const Vec3 towards{across * c, across * s, z};
  const Vec3 right = unit(cross(std::fabs(z) < 0.9 ? Vec3{0, 0, 1} : Vec3{1, 0, 0}, towards));
  return {towards, right, cross(towards, right)};
}

/// Near enough to a normal deviate of variance 1: four uniform ones added up.
double bell(CounterRng& rng) {
  return 0.86602540378443864676 * (rng.symmetric() + rng.symmetric() + rng.symmetric() + rng.symmetric());
}

class Scanner {
 public:
  Scanner(const TriangleMesh& mesh, const ScanSettings& settings)
      : settings_(settings), tree_(mesh), attributes_(mesh), mesh_(mesh) {
    const measure::Bounds bounds = measure::triangle_bounds(mesh);
    centre_ = 0.5 * (bounds.low + bounds.high);
    half_width_ = 0.51 * norm(bounds.high - bounds.low);
  }
  [[nodiscard]] bool has_colour() const { return attributes_.has_colour(); }

  /// The grid spacing at which all views together see about `count` samples.
  [[nodiscard]] double spacing_for(std::uint64_t count) const {
    constexpr int kTrialRows = 160;
    const double trial = 2 * half_width_ / kTrialRows;
    std::uint64_t seen = 0, hits = 0;
    for (int view = 0; view < settings_.views; ++view)
      for (const auto& row : look(view, trial)) {
        seen += row.samples.size();
        hits += row.hits;
      }
    // A few rays slip through between the triangles: what they see is not the mesh.
    if (seen == 0 || seen < hits / 1000)
      throw Error(ExitCode::empty, "scan: no ray hits the mesh's outside; are its triangles turned inside out?");
    return trial * std::sqrt(static_cast<double>(seen) / static_cast<double>(count));
  }

  struct Sample {
    Vec3 position, normal;
    std::array<float, 3> colour;
    float confidence;
  };
  struct Row {
    std::vector<Sample> samples;
    std::uint64_t hits = 0;  ///< rays that met the mesh, seen or not
  };

  [[nodiscard]] std::vector<Row> look(int number, double spacing) const {
    const View view = view_number(number, settings_.views);
    const auto half = static_cast<long>(std::ceil(half_width_ / spacing));
    std::vector<Row> rows(static_cast<std::size_t>(2 * half + 1));
    tbb::parallel_for(std::size_t{0}, rows.size(), [&](std::size_t r) {
      const double y = spacing * static_cast<double>(static_cast<long>(r) - half);
      for (long column = -half; column <= half; ++column)
        shoot(view, spacing * static_cast<double>(column), y, spacing,
              (static_cast<std::uint64_t>(number) << 48) + (r << 24) + static_cast<std::uint64_t>(column + half),
              rows[r]);
    });
    return rows;
  }

 private:
  void shoot(const View& view, double x, double y, double spacing, std::uint64_t ray, Row& row) const {
    const Vec3 origin = centre_ + x * view.right + y * view.up + (2 * half_width_) * view.towards;
    const auto hit = tree_.first_hit(origin, -1.0 * view.towards);
    if (!hit) return;
    ++row.hits;
    const SurfacePoint at{hit->triangle, hit->weights};
    const Vec3 normal = attributes_.normal(at);
    const double facing = dot(normal, view.towards);
    const bool outside = dot(area_normal(mesh_, hit->triangle), view.towards) > 0;
    if (!outside || facing < settings_.least_facing) return;
    CounterRng rng(settings_.seed, ray);
    const double error = settings_.noise * spacing * bell(rng);
    const Vec3 shaken = normal + settings_.normal_noise * Vec3{bell(rng), bell(rng), bell(rng)};
    row.samples.push_back({origin - (hit->distance + error) * view.towards, unit(shaken), attributes_.colour(at),
                           static_cast<float>(facing)});
  }

  const ScanSettings& settings_;
  measure::TriangleBvh tree_;
  scatter_detail::MeshAttributes attributes_;
  const TriangleMesh& mesh_;
  Vec3 centre_{};
  double half_width_ = 0;  ///< of a view's image
};

void require_sane(const TriangleMesh& mesh, const ScanSettings& s) {
  if (mesh.triangles.empty()) throw Error(ExitCode::unreadable, "scan: the mesh has no triangles");
  if (s.views < 1 || s.views > 10000)
    throw Error(ExitCode::usage, fmt::format("scan: {} views; from 1 to 10000 are possible", s.views));
  if (s.count == 0) throw Error(ExitCode::usage, "scan: --count must be at least 1");
  if (!(s.noise >= 0) || !(s.normal_noise >= 0)) throw Error(ExitCode::usage, "scan: noise must be 0 or more");
  if (!(s.least_facing >= 0) || s.least_facing >= 1)
    throw Error(ExitCode::usage, "scan: the least facing must lie in [0, 1)");
}

}  // namespace

ScanReport scan(const TriangleMesh& mesh, const ScanSettings& settings, const std::string& path,
                const RunContext& run) {
  require_sane(mesh, settings);
  ScanReport report;
  with_threads(run.threads, [&] {
    const Scanner scanner(mesh, settings);
    report.spacing = scanner.spacing_for(settings.count);
    const scatter_detail::RowLayout layout{false, scanner.has_colour(), true};
    scatter_detail::RowPacker rows(layout);
    for (int view = 0; view < settings.views; ++view)
      for (const auto& row : scanner.look(view, report.spacing))
        for (const auto& s : row.samples) {
          rows.add(s.position, s.normal, s.colour, s.confidence);
          ++report.samples;
        }
    ResultFile out(path);
    out.write(scatter_detail::ply_header(layout, report.samples));
    out.write(rows.bytes());
    out.commit();
  });
  return report;
}

}  // namespace lamina

#include "lamina/scatter.h"

#include <fmt/format.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/hashing.h"
#include "base/output_file.h"
#include "base/run.h"
#include "lamina/error.h"
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

}  // namespace lamina

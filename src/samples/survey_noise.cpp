#include "samples/survey_noise.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <unordered_map>
#include <vector>

#include "base/cell_hash.h"

namespace lamina {
namespace {

constexpr int kRuns = 4;
constexpr std::uint64_t kRunSamples = 1u << 15;
constexpr std::size_t kSeeds = 128;  ///< samples of a run whose surroundings are looked at
constexpr double kNear = 2;          ///< radii: twice that many spacings
constexpr std::size_t kLeast = 16;   ///< neighbours that a quadric takes
constexpr std::size_t kMost = 512;

struct NoiseCell {
  std::int64_t x, y, z;
  bool operator==(const NoiseCell&) const = default;
};

struct CellHash {
  std::size_t operator()(const NoiseCell& c) const { return cell_hash(c.x, c.y, c.z); }
};

/// Buckets about the sample with this rank, until they are tall enough for whole neighbourhoods or many enough.
LocalSamples read_run(const SlabStore& store, const ReadBucket& read, std::uint64_t rank, double height) {
  std::size_t middle = 0;
  while (middle + 1 < store.buckets() && rank >= store.count(middle)) rank -= store.count(middle++);
  std::size_t begin = middle;
  std::size_t end = middle + 1;
  std::uint64_t held = store.count(middle);
  std::int32_t low = store.z_lower(middle);
  std::int32_t high = store.z_upper(middle);
  while (held < kRunSamples || static_cast<double>(high) - low < height) {
    if (held >= 4 * kRunSamples || (begin == 0 && end == store.buckets())) break;
    if (begin > 0) {
      held += store.count(--begin);
      low = std::min(low, store.z_lower(begin));
    }
    if (end < store.buckets()) {
      held += store.count(end);
      high = std::max(high, store.z_upper(end++));
    }
  }
  LocalSamples all, bucket;
  for (std::size_t b = begin; b < end; ++b) {
    if (store.count(b) == 0) continue;
    read(b, bucket);
    all.x.insert(all.x.end(), bucket.x.begin(), bucket.x.end());
    all.y.insert(all.y.end(), bucket.y.begin(), bucket.y.end());
    all.z.insert(all.z.end(), bucket.z.begin(), bucket.z.end());
  }
  return all;
}

/// Distance (in units of the neighbourhood) of its origin from the quadric height field over the plane of least squares
/// through its points; negative where there is none.
double residual(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) mean += p;
  mean /= static_cast<double>(points.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : points) scatter += (p - mean) * (p - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(scatter);
  // A line of samples has no plane. Nor has a ball, but that is what much noise looks like: half of a normal
  // distribution lies within two thirds of its deviation.
  if (!(axes.eigenvalues()(1) > 4 * axes.eigenvalues()(0))) {
    if (axes.eigenvalues()(2) > 4 * axes.eigenvalues()(1)) return -1;
    return 0.67 * std::sqrt(std::max(0.0, axes.eigenvalues()(0)) / static_cast<double>(points.size()));
  }
  using Row = Eigen::Matrix<double, 6, 1>;
  Eigen::Matrix<double, 6, 6> a = Eigen::Matrix<double, 6, 6>::Zero();
  Row b = Row::Zero();
  for (const Eigen::Vector3d& p : points) {
    const Eigen::Vector3d q = axes.eigenvectors().transpose() * p;
    const Row row{1, q.y(), q.z(), q.y() * q.y(), q.y() * q.z(), q.z() * q.z()};
    a += row * row.transpose();
    b += row * q.x();
  }
  a.diagonal().array() += 1e-9 * a.trace();
  return std::abs(a.ldlt().solve(b)(0));
}

void look_around(const LocalSamples& samples, double radius, std::vector<float>& out) {
  const double reach = kNear * radius;
  const double inv = 1 / reach;
  const auto cell_of = [&](std::size_t i) {
    return NoiseCell{static_cast<std::int64_t>(std::floor(samples.x[i] * inv)),
                     static_cast<std::int64_t>(std::floor(samples.y[i] * inv)),
                     static_cast<std::int64_t>(std::floor(samples.z[i] * inv))};
  };
  const auto [low, high] = std::minmax_element(samples.z.begin(), samples.z.end());
  std::vector<std::size_t> seeds;
  const std::size_t stride = samples.size() / kSeeds + 1;
  for (std::size_t i = 0; i < samples.size(); i += stride) {
    // Neighbours beyond the run's ends are not seen.
    const double above = samples.z[i] - static_cast<double>(*low);
    const double below = static_cast<double>(*high) - samples.z[i];
    if (std::min(above, below) >= reach || static_cast<double>(*high) - *low < 3 * reach) seeds.push_back(i);
  }
  std::unordered_map<NoiseCell, std::vector<std::uint32_t>, CellHash> near;
  for (const std::size_t seed : seeds) {
    const NoiseCell c = cell_of(seed);
    for (int k = 0; k < 27; ++k) near[{c.x + k % 3 - 1, c.y + k / 3 % 3 - 1, c.z + k / 9 - 1}];
  }
  if (near.empty()) return;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto at = near.find(cell_of(i));
    if (at != near.end()) at->second.push_back(static_cast<std::uint32_t>(i));
  }
  std::vector<Eigen::Vector3d> points;
  for (const std::size_t seed : seeds) {
    points.clear();
    const NoiseCell c = cell_of(seed);
    for (int k = 0; k < 27; ++k) {
      for (const std::uint32_t i : near.at({c.x + k % 3 - 1, c.y + k / 3 % 3 - 1, c.z + k / 9 - 1})) {
        if (i == seed || points.size() >= kMost) continue;
        const Eigen::Vector3d p = Eigen::Vector3d(static_cast<double>(samples.x[i]) - samples.x[seed],
                                                  static_cast<double>(samples.y[i]) - samples.y[seed],
                                                  static_cast<double>(samples.z[i]) - samples.z[seed]) *
                                  inv;
        if (p.squaredNorm() < 1) points.push_back(p);
      }
    }
    if (points.size() < kLeast) continue;
    const double d = residual(points);
    if (d >= 0) out.push_back(static_cast<float>(d * kNear));
  }
}

}  // namespace

float survey_noise(const SlabStore& store, const ReadBucket& read, float radius) {
  constexpr double kTall = 16;
  if (store.total() == 0 || !(radius > 0)) return 0;
  std::vector<float> residuals;
  const bool small = store.total() <= kRuns * kRunSamples;
  for (int run = 0; run < (small ? 1 : kRuns); ++run) {
    const std::uint64_t rank =
        small ? store.total() / 2
              : store.total() / kRuns * static_cast<std::uint64_t>(run) + store.total() / (2 * kRuns);
    const double height = small ? std::numeric_limits<double>::infinity() : kTall * static_cast<double>(radius);
    look_around(read_run(store, read, rank, height), static_cast<double>(radius), residuals);
  }
  constexpr std::size_t kEnough = 32;
  if (residuals.size() < kEnough) return 0;
  const auto median = residuals.begin() + static_cast<std::ptrdiff_t>(residuals.size() / 2);
  std::nth_element(residuals.begin(), median, residuals.end());
  return *median;
}

}  // namespace lamina

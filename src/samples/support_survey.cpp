// survey_support(): which width of a disk predicts samples best.

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "base/vectors.h"
#include "samples/bucket_runs.h"
#include "samples/sample_tree.h"
#include "samples/support_field.h"

namespace lamina {
namespace {

constexpr std::uint64_t kPlaces = 4096;
constexpr std::uint64_t kLeastStride = 16;       ///< samples for a place
constexpr std::uint64_t kMostRead = 1ULL << 22;  ///< samples, about

/// Radii of the disks that are tried, in radii of the samples.
constexpr std::array<double, 6> kDisks{1, 1.4, 2, 2.8, 4, 5.6};
constexpr std::size_t kMiddleDisk = 2;
/// Samples in a disk that have something to say of it, and among which the spacing is measured.
constexpr std::size_t kLeastInDisk = 8;
constexpr std::size_t kCounted = 16;

/// Neighbouring places that are looked at together: a place alone is a single draw.
constexpr std::size_t kPooled = 32;
/// Errors count at most so many medians of all: strays.
constexpr float kMostError = 3;

/// H for a radius of the best disk. The fit of the projection knows normals as well, so it is as sure in a narrower
/// one.
constexpr double kSupportPerDisk = 0.65;
/// H is at least so much, and so much more for each radius of error: fits to few very noisy samples go astray.
constexpr double kLeastBlend = 1.1;
constexpr double kBlendPerError = 3.5;

/// A neighbour in the frame of the mean normal around a seed, in radii of the samples.
struct FlatNeighbour {
  double x, y, height;
};

/// How far a seed, the origin, is from what disks of neighbours suggest, in radii; without the last ones where the
/// disks are wider than neighbours are known.
struct Trial {
  std::array<float, kDisks.size()> error{};
};

/// The height at the origin of the paraboloid of revolution fitted to the neighbours in a disk, with the projection's
/// weights (method.md, "Weights and fit"), the second time without strays; nothing where there are too few.
std::optional<double> height_over(const std::vector<FlatNeighbour>& neighbours, double disk) {
  // What lies this far off is of another sheet.
  const double thick = std::max(disk, 2.0);
  std::vector<std::pair<const FlatNeighbour*, double>> weighted;
  for (const FlatNeighbour& n : neighbours) {
    const double inside = 1 - (n.x * n.x + n.y * n.y) / (disk * disk);
    if (inside > 0 && std::abs(n.height) < thick) weighted.emplace_back(&n, inside * inside * inside * inside);
  }
  if (weighted.size() < kLeastInDisk) return std::nullopt;
  const auto terms = [&](const FlatNeighbour& n) {
    const double x = n.x / disk, y = n.y / disk;
    return Eigen::Vector4d(1, x, y, x * x + y * y);
  };
  const auto fit = [&] {
    Eigen::Matrix4d a = Eigen::Matrix4d::Zero();
    Eigen::Vector4d b = Eigen::Vector4d::Zero();
    for (const auto& [n, weight] : weighted) {
      const Eigen::Vector4d t = terms(*n);
      a += weight * t * t.transpose();
      b += weight * n->height * t;
    }
    a.diagonal().array() += 1e-6 * a.trace();
    return Eigen::Vector4d(a.ldlt().solve(b));
  };
  const Eigen::Vector4d first = fit();
  std::vector<double> residuals;
  residuals.reserve(weighted.size());
  for (const auto& [n, weight] : weighted) residuals.push_back(std::abs(n->height - first.dot(terms(*n))));
  std::vector<double> sorted = residuals;
  constexpr double kStrayMedians = 4;
  const double far = kStrayMedians * median_of(sorted);
  if (!(far > 0)) return first(0);
  for (std::size_t i = 0; i < weighted.size(); ++i) {
    const double inside = std::max(0.0, 1 - residuals[i] * residuals[i] / (far * far));  // Tukey's weights
    weighted[i].second *= inside * inside;
  }
  return fit()(0);
}

/// What the neighbours of a seed say; nothing where they are too few. `given`: its radius where the input has it, in
/// units of the reach, else 0.
std::optional<Trial> try_disks(const SeedNeighbourhoods& of, std::size_t seed, double given) {
  const Eigen::Vector3d own = of.normal(seed);
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> facing;  // place, normal
  std::vector<double> squared;
  of.around(seed, [&](std::uint32_t i, const Eigen::Vector3d& place) {
    squared.push_back(place.squaredNorm());
    if (of.normal(i).dot(own) > 0) facing.emplace_back(place, of.normal(i));
  });
  if (squared.size() < kCounted || facing.size() < kCounted) return std::nullopt;
  // Two spacings, of samples spread evenly over the disk that just holds so many.
  const auto last = squared.begin() + (kCounted - 1);
  std::nth_element(squared.begin(), last, squared.end());
  const double radius = given > 0 ? given : 2 * std::sqrt(std::numbers::pi / kCounted * *last);
  if (!(radius > 0)) return std::nullopt;
  constexpr double kAxisReach = 2.5;
  Eigen::Vector3d axis = own;
  for (const auto& [place, normal] : facing) {
    if (place.norm() < kAxisReach * radius) axis += normal;
  }
  axis.normalize();
  const Eigen::Vector3d u = axis.unitOrthogonal();
  const Eigen::Vector3d v = axis.cross(u);
  std::vector<FlatNeighbour> neighbours;
  neighbours.reserve(facing.size());
  for (const auto& [place, normal] : facing)
    neighbours.push_back({place.dot(u) / radius, place.dot(v) / radius, place.dot(axis) / radius});
  Trial trial;
  for (std::size_t k = 0; k < kDisks.size(); ++k) {
    if (k > kMiddleDisk && kDisks[k] * radius > 1) {
      trial.error[k] = trial.error[k - 1];
      continue;
    }
    const std::optional<double> height = height_over(neighbours, kDisks[k]);
    if (!height) return std::nullopt;
    trial.error[k] = static_cast<float>(std::abs(*height));
  }
  return trial;
}

struct Place {
  std::array<std::int32_t, 3> at{};
  Trial trial;
};

/// Buckets whose samples are seeds, and with those around that hold their neighbours.
struct SurveyRun {
  BucketSpan seeds, read;
};

/// Runs twice as tall as the reach, or all of the store; of a long one some, evenly.
std::vector<SurveyRun> choose_runs(const SlabStore& store, double reach) {
  std::vector<SurveyRun> runs;
  for (std::size_t begin = 0; begin < store.buckets();) {
    BucketSpan seeds{begin, begin + 1};
    while (seeds.end < store.buckets() && z_range(store, seeds).height() < 2 * reach) ++seeds.end;
    begin = seeds.end;
    if (samples_in(store, seeds) == 0) continue;
    BucketSpan read = seeds;
    const ZRange z = z_range(store, seeds);
    // Empty buckets tell nothing of those beyond them.
    const auto wanted = [&](std::size_t b) {
      return store.count(b) == 0 || (static_cast<double>(store.z_upper(b)) >= z.low - reach &&
                                     static_cast<double>(store.z_lower(b)) <= z.high + reach);
    };
    while (read.begin > 0 && wanted(read.begin - 1)) --read.begin;
    while (read.end < store.buckets() && wanted(read.end)) ++read.end;
    runs.push_back({seeds, read});
  }
  const std::size_t stride = static_cast<std::size_t>(store.total() / kMostRead) + 1;
  std::vector<SurveyRun> chosen;
  for (std::size_t i = stride / 2; i < runs.size(); i += stride) chosen.push_back(runs[i]);
  return chosen.empty() ? runs : chosen;
}

/// The best disk of some trials, and its error.
struct BestDisk {
  double radius = 0, error = 0;
};
BestDisk best_of(const std::array<double, kDisks.size()>& squares) {
  const auto least = std::min_element(squares.begin(), squares.end());
  const auto k = static_cast<std::size_t>(least - squares.begin());
  double radius = kDisks[k];
  if (k > 0 && k + 1 < kDisks.size()) {
    // Where the parabola through three has its lowest point.
    const double bend = squares[k - 1] - 2 * squares[k] + squares[k + 1];
    const double step = bend > 0 ? 0.5 * (squares[k - 1] - squares[k + 1]) / bend : 0;
    radius += step * (step > 0 ? kDisks[k + 1] - kDisks[k] : kDisks[k] - kDisks[k - 1]);
  }
  return {radius, std::sqrt(*least)};
}

/// H by what the places around say together.
std::vector<SupportPlace> pooled(const std::vector<Place>& places) {
  std::vector<float> errors;
  errors.reserve(places.size());
  std::array<std::vector<std::int32_t>, 3> at;
  for (const Place& p : places) {
    errors.push_back(p.trial.error[kMiddleDisk]);
    for (std::size_t k = 0; k < 3; ++k) at[k].push_back(p.at[k]);
  }
  const float most = kMostError * median_of(errors);
  const SampleTree tree(at[0], at[1], at[2]);
  std::vector<SupportPlace> out(places.size());
  tbb::parallel_for(std::size_t{0}, places.size(), [&](std::size_t p) {
    std::array<Neighbour, kPooled - 1> found;
    const std::size_t n =
        tree.nearest(static_cast<std::uint32_t>(p), found.size(), std::numeric_limits<float>::infinity(), found.data());
    std::array<double, kDisks.size()> squares{};
    const auto add = [&](std::uint32_t place) {
      const Trial& t = places[tree.order()[place]].trial;
      for (std::size_t k = 0; k < kDisks.size(); ++k) {
        const double error = static_cast<double>(std::min(t.error[k], most));
        squares[k] += error * error / static_cast<double>(n + 1);
      }
    };
    add(static_cast<std::uint32_t>(p));
    for (std::size_t i = 0; i < n; ++i) add(found[i].sample);
    const BestDisk best = best_of(squares);
    const double wanted = std::max(kSupportPerDisk * best.radius, kLeastBlend + kBlendPerError * best.error);
    const auto blend = std::clamp(static_cast<float>(wanted), kLeastSupport, kMostSupport);
    SupportPlace& made = out[tree.order()[p]];
    made.blend = blend;
    for (std::size_t k = 0; k < 3; ++k) made.at[k] = static_cast<float>(places[tree.order()[p]].at[k]);
  });
  return out;
}

}  // namespace

std::vector<SupportPlace> survey_support(const SlabStore& store, const ReadBucket& read, const RadiusSurvey& survey) {
  constexpr float kFarthest = 4;  // medians: where samples lie farther apart than this, narrower disks must do
  const double reach = kDisks.back() * static_cast<double>(std::min(survey.high, kFarthest * survey.median));
  if (!(reach > 0)) return {};
  const std::vector<SurveyRun> runs = choose_runs(store, reach);
  std::uint64_t total = 0;
  for (const SurveyRun& run : runs) total += samples_in(store, run.seeds);
  const std::uint64_t stride = std::max(kLeastStride, total / kPlaces);
  std::vector<Place> places;
  std::uint64_t passed = 0;
  for (const SurveyRun& run : runs) {
    const LocalSamples samples = read_oriented(store, read, run.read);
    const std::uint64_t first = samples_in(store, {run.read.begin, run.seeds.begin});
    const std::uint64_t count = samples_in(store, run.seeds);
    std::vector<std::size_t> seeds;
    for (std::uint64_t i = (stride - passed % stride) % stride; i < count; i += stride) seeds.push_back(first + i);
    passed += count;
    const SeedNeighbourhoods around(samples, reach, std::move(seeds));
    std::vector<std::optional<Trial>> trials(around.seeds().size());
    tbb::parallel_for(std::size_t{0}, trials.size(), [&](std::size_t s) {
      const std::size_t seed = around.seeds()[s];
      const double given = samples.radius.empty() ? 0 : static_cast<double>(samples.radius[seed]) / reach;
      trials[s] = try_disks(around, seed, given);
    });
    for (std::size_t s = 0; s < trials.size(); ++s) {
      const std::size_t seed = around.seeds()[s];
      if (trials[s]) places.push_back({{samples.x[seed], samples.y[seed], samples.z[seed]}, *trials[s]});
    }
  }
  if (places.empty()) return {};
  return pooled(places);
}

}  // namespace lamina

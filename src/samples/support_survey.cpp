// survey_support(): how well disks of several widths predict samples.

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/nth_value.h"
#include "base/vectors.h"
#include "samples/all_round.h"
#include "samples/bucket_runs.h"
#include "samples/sample_tree.h"
#include "samples/support_field.h"
#include "samples/support_pools.h"

namespace lamina {
namespace {

constexpr std::uint64_t kPlaces = 4096;
constexpr std::uint64_t kLeastStride = 16;       ///< samples for a place
constexpr std::uint64_t kMostRead = 1ULL << 22;  ///< samples, about

/// Samples in a disk that have something to say of it, and among which the spacing is measured.
constexpr std::size_t kLeastInDisk = 8;
constexpr std::size_t kCounted = 16;

constexpr float kMostByDensity = 1.1F;  ///< radii nearby: what counts of samples make of those out there
constexpr float kMostAround = 8;        ///< radii: neighbours farther away are not looked at

typedef float Four __attribute__((vector_size(16)));  // NOLINT(modernize-use-using): attributes on typedefs

/// Neighbours in the frame of the mean normal around a seed, in radii of the samples; one array each, so that four are
/// looked at at once.
struct FlatNeighbours {
  std::vector<float> x, y, height, weight;
  std::size_t count = 0;  ///< behind them come some of weight 0, up to a multiple of four

  void resize(std::size_t n) {
    count = n;
    for (std::vector<float>* v : {&x, &y, &height, &weight}) v->assign((n + 3) / 4 * 4, 0);
  }
  /// Leaves out those beyond a disk, weighs the others as the projection does (method.md, "Weights and fit").
  void keep_within(float disk) {
    // What lies this far off is of another sheet.
    const float thick = std::max(disk, 2.0F);
    const float inverse = 1 / (disk * disk);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const float inside = 1 - (x[i] * x[i] + y[i] * y[i]) * inverse;
      x[kept] = x[i];
      y[kept] = y[i];
      height[kept] = height[i];
      weight[kept] = inside * inside * (inside * inside);
      kept += static_cast<std::size_t>(static_cast<int>(inside > 0) & static_cast<int>(std::abs(height[i]) < thick));
    }
    std::fill(weight.begin() + static_cast<std::ptrdiff_t>(kept), weight.end(), 0.0F);
    count = kept;
  }
};

Four four(const std::vector<float>& v, std::size_t i) {
  Four out;
  std::memcpy(&out, v.data() + i, sizeof(out));
  return out;
}

/// The paraboloid of revolution, 1, x, y and x^2 + y^2 (in units of the disk), through the neighbours by their weights.
Eigen::Vector4f paraboloid(const FlatNeighbours& around, float disk) {
  const float inverse = 1 / disk;
  enum : std::uint8_t { kW, kX, kY, kXX, kXY, kYY, kXQ, kYQ, kQQ, kH, kHX, kHY, kHQ, kAll };
  std::array<Four, kAll> sums{};
  for (std::size_t i = 0; i < around.count; i += 4) {
    const Four x = four(around.x, i) * inverse;
    const Four y = four(around.y, i) * inverse;
    const Four q = x * x + y * y;
    const Four w = four(around.weight, i);
    const Four h = w * four(around.height, i);
    const Four wx = w * x, wy = w * y, wq = w * q;
    sums[kW] += w;
    sums[kX] += wx;
    sums[kY] += wy;
    sums[kXX] += wx * x;
    sums[kXY] += wx * y;
    sums[kYY] += wy * y;
    sums[kXQ] += wx * q;
    sums[kYQ] += wy * q;
    sums[kQQ] += wq * q;
    sums[kH] += h;
    sums[kHX] += h * x;
    sums[kHY] += h * y;
    sums[kHQ] += h * q;
  }
  const auto sum = [&](int k) {
    const Four& v = sums[static_cast<std::size_t>(k)];
    return static_cast<double>((v[0] + v[1]) + (v[2] + v[3]));
  };
  Eigen::Matrix4d a = Eigen::Matrix4d::Zero();  // the lower half
  a.col(0) << sum(kW), sum(kX), sum(kY), sum(kXX) + sum(kYY);
  a.col(1).tail<3>() << sum(kXX), sum(kXY), sum(kXQ);
  a.col(2).tail<2>() << sum(kYY), sum(kYQ);
  a(3, 3) = sum(kQQ);
  a.diagonal().array() += 1e-6 * a.trace();
  return a.ldlt().solve(Eigen::Vector4d(sum(kH), sum(kHX), sum(kHY), sum(kHQ))).cast<float>();
}

/// How far neighbours are from a paraboloid.
void find_residuals(const FlatNeighbours& around, float disk, const Eigen::Vector4f& of, std::vector<float>& out) {
  const float inverse = 1 / disk;
  out.resize(around.count);
  for (std::size_t i = 0; i < around.count; ++i) {
    const float x = around.x[i] * inverse;
    const float y = around.y[i] * inverse;
    out[i] = std::abs(around.height[i] - (of(0) + of(1) * x + of(2) * y + of(3) * (x * x + y * y)));
  }
}

/// Memory kept from seed to seed.
struct TrialScratch {
  std::vector<std::uint32_t> found;
  std::vector<Eigen::Vector3f> places;
  std::vector<float> squared, residuals, sorted;
  FlatNeighbours neighbours;
};

/// The height at the origin of the paraboloid fitted to the neighbours that are left, those in a disk, the second time
/// without strays; nothing where they are too few.
std::optional<float> height_over(float disk, TrialScratch& scratch) {
  FlatNeighbours& around = scratch.neighbours;
  if (around.count < kLeastInDisk) return std::nullopt;
  const Eigen::Vector4f first = paraboloid(around, disk);
  find_residuals(around, disk, first, scratch.residuals);
  scratch.sorted = scratch.residuals;
  constexpr float kStrayMedians = 4;
  const float far = kStrayMedians * median_of(scratch.sorted);
  if (!(far > 0)) return first(0);
  for (std::size_t i = 0; i < around.count; ++i) {
    const float share = scratch.residuals[i] / far;
    const float inside = std::max(0.0F, 1 - share * share);  // Tukey's weights
    around.weight[i] *= inside * inside;
  }
  return paraboloid(around, disk)(0);
}

/// How far away neighbours lie on all sides of a seed, in radii of the density out there, where `farthest` (radii of
/// the samples nearby) is enough; else infinite. Along a line of samples those nearby are denser than the surface.
float all_round(const FlatNeighbours& neighbours, float farthest) {
  AllRound sides;
  float within = 0;
  for (std::size_t i = 0; i < neighbours.count; ++i) {
    const float x = neighbours.x[i], y = neighbours.y[i];
    if (std::abs(neighbours.height[i]) > farthest || x * x + y * y > farthest * farthest) continue;
    sides.add(x, y);
    within += 1;
  }
  const float distance = sides.distance();
  if (!(distance <= farthest)) return std::numeric_limits<float>::infinity();
  return distance / std::min(kMostByDensity, 2 * farthest * std::sqrt(std::numbers::pi_v<float> / within));
}

/// What the neighbours of a seed say; nothing where they are too few. `given`: its radius where the input has it, in
/// units of the reach, else 0.
std::optional<Trial> try_disks(const SeedNeighbourhoods& of, std::size_t seed, double given, TrialScratch& scratch) {
  const Eigen::Vector3f own = of.normal(seed).cast<float>();
  std::vector<std::uint32_t>& found = scratch.found;
  std::vector<Eigen::Vector3f>& places = scratch.places;
  std::vector<float>& squared = scratch.squared;
  std::vector<float>& sorted = scratch.sorted;
  FlatNeighbours& neighbours = scratch.neighbours;
  found.clear();
  places.clear();
  squared.clear();
  of.around(seed, [&](std::uint32_t i, const Eigen::Vector3d& place) {
    found.push_back(i);
    places.emplace_back(place.cast<float>());
    squared.push_back(places.back().squaredNorm());
  });
  if (found.size() < kCounted) return std::nullopt;
  // Two spacings, of samples spread evenly over the disk that just holds so many.
  sorted = squared;
  const float last = nth_value(std::span(sorted), kCounted - 1);
  const float radius =
      given > 0 ? static_cast<float>(given) : 2 * std::sqrt(std::numbers::pi_v<float> / kCounted * last);
  if (!(radius > 0)) return std::nullopt;
  constexpr float kAxisReach = 2.5F;
  constexpr float kFarthest = 2 * kMostAround * kMostAround;  // squared: a disk is no thicker than it is wide
  Eigen::Vector3f axis = own;
  std::size_t facing = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (squared[i] > kFarthest * radius * radius) continue;
    const Eigen::Vector3f normal = of.normal(found[i]).cast<float>();
    if (!(normal.dot(own) > 0)) continue;
    if (squared[i] < kAxisReach * kAxisReach * radius * radius) axis += normal;
    places[facing++] = places[i];
  }
  if (facing < kCounted) return std::nullopt;
  axis.normalize();
  const Eigen::Vector3f u = axis.unitOrthogonal() / radius;
  const Eigen::Vector3f v = axis.cross(u);
  axis /= radius;
  neighbours.resize(facing);
  for (std::size_t i = 0; i < facing; ++i) {
    neighbours.x[i] = places[i].dot(u);
    neighbours.y[i] = places[i].dot(v);
    neighbours.height[i] = places[i].dot(axis);
  }
  std::size_t known = kDisks.size();  // of the disks
  while (known > kMiddleDisk + 1 && kDisks[known - 1] * radius > 1) --known;
  Trial trial;
  trial.all_round = all_round(neighbours, std::min(1 / radius, kMostAround));
  for (std::size_t k = known; k-- > 0;) {
    neighbours.keep_within(kDisks[k]);
    const std::optional<float> height = height_over(kDisks[k], scratch);
    if (!height) return std::nullopt;
    trial.error[k] = std::abs(*height);
  }
  std::fill(trial.error.begin() + static_cast<std::ptrdiff_t>(known), trial.error.end(), trial.error[known - 1]);
  return trial;
}

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

}  // namespace

SupportSurvey survey_support(const SlabStore& store, const ReadBucket& read, const RadiusSurvey& survey,
                             SupportAim aim) {
  constexpr float kFarthest = 4;  // medians: where samples lie farther apart than this, narrower disks must do
  const double reach = double{kDisks.back()} * static_cast<double>(std::min(survey.high, kFarthest * survey.median));
  if (!(reach > 0)) return {};
  const std::vector<SurveyRun> runs = choose_runs(store, reach);
  std::uint64_t total = 0;
  for (const SurveyRun& run : runs) total += samples_in(store, run.seeds);
  const std::uint64_t stride = std::max(kLeastStride, total / kPlaces);
  tbb::enumerable_thread_specific<TrialScratch> scratch;
  std::vector<TriedPlace> places;
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
      trials[s] = try_disks(around, seed, given, scratch.local());
    });
    for (std::size_t s = 0; s < trials.size(); ++s) {
      const std::size_t seed = around.seeds()[s];
      if (trials[s]) places.push_back({{samples.x[seed], samples.y[seed], samples.z[seed]}, *trials[s]});
    }
  }
  if (places.empty()) return {};
  return pool_places(places, aim);
}

}  // namespace lamina

#include "samples/sampling_survey.h"

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "base/vectors.h"
#include "samples/all_round.h"
#include "samples/consensus_plane.h"

namespace lamina {
namespace {

/// Runs of buckets are this many radii tall, so that most cells, and neighbourhoods, are seen whole.
constexpr double kRunHeight = 16;

/// The bucket of the sample with this rank.
std::size_t bucket_of_rank(const SlabStore& store, std::uint64_t rank) {
  std::size_t b = 0;
  while (b + 1 < store.buckets() && rank >= store.count(b)) rank -= store.count(b++);
  return b;
}

// Density.

/// Shares of the samples below RadiusSurvey's low, median and high: of a hundred thousand samples a thousand at either
/// end, far more than single cells that the surface clips.
constexpr double kLow = 0.01, kMiddle = 0.5, kHigh = 0.99;

CutEnds ends_of(const SlabStore& store, BucketSpan run) {
  return {run.begin > 0, run.end < store.buckets()};
}

std::vector<WeightedRadius> run_radii(const SlabStore& store, const ReadBucket& read, BucketSpan run,
                                      std::uint32_t min_samples) {
  return density_radii(read_oriented(store, read, run), ends_of(store, run), min_samples);
}

void add_given_radii(const ReadBucket& read, BucketSpan run, std::vector<WeightedRadius>& radii) {
  LocalSamples bucket;
  for (std::size_t b = run.begin; b < run.end; ++b) {
    read(b, bucket);
    for (const float r : bucket.radius) radii.push_back({r, 1});
  }
}

/// How many buckets make a run tall enough.
std::size_t buckets_in_run(const SlabStore& store, const ReadBucket& read, std::uint64_t sample_limit,
                           std::uint32_t min_samples) {
  const std::size_t middle = bucket_of_rank(store, store.total() / 2);
  for (std::size_t n = 1;; n *= 2) {
    const std::size_t begin = middle - std::min(middle, n / 2);
    const BucketSpan run{begin, std::min(store.buckets(), begin + n)};
    if (samples_in(store, run) >= sample_limit || run.end - run.begin == store.buckets()) return n;
    const auto radii = run_radii(store, read, run, min_samples);
    if (radii.empty()) continue;
    if (z_range(store, run).height() >= kRunHeight * static_cast<double>(quantile(radii, samples_of(radii), kMiddle)))
      return n;
  }
}

/// Runs of `size` buckets about evenly spaced ranks, as many as the limit allows; they do not overlap.
std::vector<BucketSpan> choose_runs(const SlabStore& store, std::uint64_t sample_limit, std::size_t size) {
  if (store.total() <= sample_limit) return {{0, store.buckets()}};
  const double share = static_cast<double>(sample_limit) / static_cast<double>(store.total());
  const double most = static_cast<double>(store.buckets()) / static_cast<double>(size);
  const auto number = static_cast<std::uint64_t>(std::max(1.0, std::floor(share * most)));
  std::vector<BucketSpan> runs;
  std::size_t free = 0;
  for (std::uint64_t i = 0; i < number; ++i) {
    const auto rank = static_cast<double>(store.total()) * (static_cast<double>(i) + 0.5) / static_cast<double>(number);
    const std::size_t middle = bucket_of_rank(store, static_cast<std::uint64_t>(rank));
    const std::size_t begin = std::max(free, middle - std::min(middle, size / 2));
    const std::size_t end = std::min(store.buckets(), begin + size);
    if (begin < end) runs.push_back({begin, end});
    free = std::max(free, end);
  }
  return runs;
}

// Noise: samples against what their neighbours suggest.

constexpr int kRuns = 4;  ///< from all over the cloud
constexpr std::uint64_t kRunSamples =
    1u << 15;                        ///< a run has at least this many samples and at most four times as many
constexpr std::size_t kSeeds = 128;  ///< samples of a run whose surroundings are looked at
/// Neighbours are looked for as far as this, in radii: four spacings, some fifty samples, eight times what a quadric of
/// six coefficients needs; farther ones would take curvature for noise.
constexpr double kNeighbourhood = 2;
constexpr std::size_t kLeast = 16;  ///< neighbours that a quadric takes
constexpr std::size_t kMost = 512;
constexpr std::size_t kEnough = 32;  ///< values that make a median
/// Ratio of the second moments along two axes from which on the neighbours are flat, or on a line.
constexpr double kFlat = 4;
/// And from which on they are on a line even if that is flat: of lines far apart a neighbourhood holds one.
constexpr double kLine = 32;
/// Half of a normal distribution lies within so many of its deviations.
constexpr double kMedianDeviation = 0.67;

/// Buckets about the sample with this rank, until they are tall enough for whole neighbourhoods or many enough. It
/// grows by so many buckets as hold a run's samples, that runs be as wide whatever the buckets' size.
BucketSpan noise_run(const SlabStore& store, std::uint64_t rank, double height) {
  std::uint64_t filled = 0;
  for (std::size_t b = 0; b < store.buckets(); ++b) filled += store.count(b) > 0 ? 1 : 0;
  const double in_run =
      static_cast<double>(kRunSamples * filled) / static_cast<double>(std::max<std::uint64_t>(store.total(), 1));
  const auto step = static_cast<std::size_t>(std::max(std::round(in_run), 1.0));
  const std::size_t first = bucket_of_rank(store, rank) / step * step;
  BucketSpan run{first, std::min(first + step, store.buckets())};
  for (;;) {
    const std::uint64_t held = samples_in(store, run);
    if (held >= kRunSamples && z_range(store, run).height() >= height) return run;
    if (held >= 4 * kRunSamples || (run.begin == 0 && run.end == store.buckets())) return run;
    run.begin -= std::min(run.begin, step);
    run.end = std::min(run.end + step, store.buckets());
  }
}

/// How a sample lies to the surface that its neighbours suggest.
struct Deviation {
  double distance = -1;  ///< in units of the neighbourhood; negative where there is no surface
  double angle = -1;     ///< of the normals, either way, radians; negative where there is none
};

/// Of the origin with a normal from the quadric height field over the plane of least squares through the points.
Deviation deviation(const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& normal) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) mean += p;
  mean /= static_cast<double>(points.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : points) scatter += (p - mean) * (p - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(scatter);
  if (axes.eigenvalues()(2) > kLine * axes.eigenvalues()(1)) return {};
  // A line of samples has no plane. Nor has a ball, but that is what much noise looks like.
  if (!(axes.eigenvalues()(1) > kFlat * axes.eigenvalues()(0))) {
    if (axes.eigenvalues()(2) > kFlat * axes.eigenvalues()(1)) return {};
    const double across = std::max(0.0, axes.eigenvalues()(0)) / static_cast<double>(points.size());
    return {kMedianDeviation * std::sqrt(across), -1};
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
  const Row height = a.ldlt().solve(b);
  const Eigen::Vector3d across = axes.eigenvectors() * Eigen::Vector3d(1, -height(1), -height(2)).normalized();
  const double angle = normal.isZero() ? -1 : std::acos(std::min(1.0, std::abs(across.dot(normal))));
  return {std::abs(height(0)), angle};
}

/// Samples of a run whose neighbours, within so many steps, are not cut off at its ends.
std::vector<std::size_t> choose_seeds(const LocalSamples& samples, double reach) {
  std::vector<std::size_t> seeds;
  const auto [low, high] = std::minmax_element(samples.z.begin(), samples.z.end());
  const std::size_t stride = samples.size() / kSeeds + 1;
  for (std::size_t i = 0; i < samples.size(); i += stride) {
    const double above = samples.z[i] - static_cast<double>(*low);
    const double below = static_cast<double>(*high) - samples.z[i];
    if (std::min(above, below) >= reach || static_cast<double>(*high) - *low < 3 * reach) seeds.push_back(i);
  }
  return seeds;
}

/// The places about the seed of neighbours that do not face the other way: the two sides of a thin wall or a spine are
/// no noise of each other.
void gather(const SeedNeighbourhoods& of, std::size_t seed, std::vector<Eigen::Vector3d>& out) {
  out.clear();
  const Eigen::Vector3d facing = of.normal(seed);
  of.around(seed, [&](std::uint32_t i, const Eigen::Vector3d& place) {
    if (out.size() < kMost && of.normal(i).dot(facing) >= 0) out.push_back(place);
  });
}

/// A normal that lies so far from the surface, 15 degrees, was interpolated over an edge and not over facets.
constexpr float kBlurredCosine = 0.966F;

/// Whether the normal of the origin is worse than a plane that its neighbours agree on; their places in units of the
/// neighbourhood.
bool is_blurred(const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& normal, ConsensusPlane& plane) {
  if (normal.isZero()) return false;
  constexpr double kNearer = kNeighbourhood / double{kConsensusReach};
  plane.neighbours.clear();
  for (const Eigen::Vector3d& p : points) {
    const Eigen::Vector3f q = (kNearer * p).cast<float>();
    if (q.squaredNorm() < 1) plane.neighbours.push_back({q.x(), q.y(), q.z()});
  }
  const Eigen::Vector3f own = normal.cast<float>();
  std::array<float, 3> found{};
  return plane.find({own.x(), own.y(), own.z()}, found) &&
         found[0] * own.x() + found[1] * own.y() + found[2] * own.z() < kBlurredCosine;
}

/// Within four times the distance of the nearest eight: on a surface there are sixteen times as many, on a line four.
bool is_lined(const std::vector<Eigen::Vector3d>& points) {
  constexpr std::size_t kNear = 8, kFew = 8 * kNear;
  if (points.size() <= kNear || points.size() == kMost) return false;
  std::vector<double> squared;
  squared.reserve(points.size());
  for (const Eigen::Vector3d& p : points) squared.push_back(p.squaredNorm());
  std::nth_element(squared.begin(), squared.begin() + kNear - 1, squared.end());
  const double far = 16 * squared[kNear - 1];
  if (far > 1) return false;  // neighbours are not known as far
  return std::count_if(squared.begin(), squared.end(), [&](double d) { return d < far; }) <
         static_cast<std::ptrdiff_t>(kFew);
}

/// Radii within which a sample has neighbours on all sides: nine in ten of an evenly sampled surface have.
constexpr double kAllRoundWithin = 1.4;

bool is_lopsided(const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& normal) {
  if (normal.isZero()) return false;
  const Eigen::Vector3d u = normal.unitOrthogonal();
  const Eigen::Vector3d v = normal.cross(u);
  AllRound sides;
  for (const Eigen::Vector3d& p : points) sides.add(static_cast<float>(p.dot(u)), static_cast<float>(p.dot(v)));
  return !(static_cast<double>(sides.distance()) <= kAllRoundWithin / kNeighbourhood);
}

/// quantile_of(), or 0 where there are too few values to tell.
float quantile_of_enough(std::vector<float>& values, double share) {
  return values.size() < kEnough ? 0 : quantile_of(values, share);
}

std::array<float, 3> middle_of(const LocalSamples& samples, const std::vector<std::size_t>& seeds) {
  std::array<double, 3> sum{};
  for (const std::size_t seed : seeds) {
    sum[0] += samples.x[seed];
    sum[1] += samples.y[seed];
    sum[2] += samples.z[seed];
  }
  std::array<float, 3> middle{};
  for (std::size_t k = 0; k < 3; ++k) middle[k] = static_cast<float>(sum[k] / static_cast<double>(seeds.size()));
  return middle;
}

}  // namespace

namespace {

/// What a run's seeds tell.
struct RunNoise {
  std::vector<float> distances, angles;
  std::size_t looked_at = 0, blurred = 0, lopsided = 0, lined = 0;
  std::array<float, 3> middle{};
};

/// `reach`: how far neighbours are looked for, steps.
RunNoise noise_of(const LocalSamples& samples, double reach) {
  const SeedNeighbourhoods around(samples, reach, choose_seeds(samples, reach));
  RunNoise out;
  std::vector<Eigen::Vector3d> neighbours;
  ConsensusPlane plane;
  for (const std::size_t seed : around.seeds()) {
    gather(around, seed, neighbours);
    if (neighbours.size() < kLeast) continue;
    ++out.looked_at;
    out.lined += is_lined(neighbours) ? 1 : 0;
    out.lopsided += is_lopsided(neighbours, around.normal(seed)) ? 1 : 0;
    out.blurred += is_blurred(neighbours, around.normal(seed), plane) ? 1 : 0;
    const Deviation d = deviation(neighbours, around.normal(seed));
    if (d.distance >= 0) out.distances.push_back(static_cast<float>(d.distance * kNeighbourhood));
    if (d.angle >= 0) out.angles.push_back(static_cast<float>(d.angle));
  }
  out.middle = middle_of(samples, around.seeds());
  return out;
}

}  // namespace

Noise survey_noise(const SlabStore& store, const ReadBucket& read, float radius) {
  if (store.total() == 0 || !(radius > 0)) return {};
  const bool small = store.total() <= kRuns * kRunSamples;
  const double height = small ? std::numeric_limits<double>::infinity() : kRunHeight * static_cast<double>(radius);
  std::vector<LocalSamples> samples;  // ranks read together, one bucket after the other
  for (int run = 0; run < (small ? 1 : kRuns); ++run) {
    const std::uint64_t rank =
        small ? store.total() / 2
              : store.total() / kRuns * static_cast<std::uint64_t>(run) + store.total() / (2 * kRuns);
    samples.push_back(read_oriented(store, read, noise_run(store, rank, height)));
  }
  std::vector<RunNoise> found(samples.size());
  tbb::parallel_for(std::size_t{0}, found.size(), [&](std::size_t run) {
    found[run] = noise_of(samples[run], kNeighbourhood * static_cast<double>(radius));
  });
  RunNoise all;
  Noise noise;
  for (RunNoise& run : found) {
    all.distances.insert(all.distances.end(), run.distances.begin(), run.distances.end());
    all.angles.insert(all.angles.end(), run.angles.begin(), run.angles.end());
    all.looked_at += run.looked_at;
    all.blurred += run.blurred;
    all.lopsided += run.lopsided;
    all.lined += run.lined;
    if (const float median = quantile_of_enough(run.distances, 0.5); median > noise.worst) {
      noise.worst = median;
      noise.worst_at = run.middle;
    }
  }
  constexpr double kAllButATenth = 0.9;
  noise.distance = quantile_of_enough(all.distances, 0.5);
  noise.high = quantile_of_enough(all.distances, kAllButATenth);
  noise.angle = quantile_of_enough(all.angles, 0.5);
  if (all.looked_at < kEnough) return noise;
  const auto share = [&](std::size_t of) { return static_cast<float>(of) / static_cast<float>(all.looked_at); };
  noise.blurred = share(all.blurred);
  noise.lined = share(all.lined);
  noise.lopsided = share(all.lopsided);
  return noise;
}

namespace {

RadiusSurvey survey_density(const SlabStore& store, const ReadBucket& read, std::uint64_t sample_limit,
                            std::uint32_t min_samples) {
  RadiusSurvey survey;
  if (store.total() == 0) return survey;
  const bool given = store.layout().has_radius;
  const bool whole = store.total() <= sample_limit;
  const std::size_t size = given || whole ? 1 : buckets_in_run(store, read, sample_limit, min_samples);
  std::vector<LocalSamples> samples;
  std::vector<CutEnds> cut;
  std::vector<WeightedRadius> radii;
  for (const BucketSpan& run : choose_runs(store, sample_limit, size)) {
    survey.samples += samples_in(store, run);
    if (given) {
      add_given_radii(read, run, radii);
    } else {
      samples.push_back(read_oriented(store, read, run));
      cut.push_back(ends_of(store, run));
    }
  }
  std::vector<std::vector<WeightedRadius>> found(samples.size());
  tbb::parallel_for(std::size_t{0}, found.size(),
                    [&](std::size_t run) { found[run] = density_radii(samples[run], cut[run], min_samples); });
  for (const auto& of_run : found) radii.insert(radii.end(), of_run.begin(), of_run.end());
  if (radii.empty()) return survey;
  std::sort(radii.begin(), radii.end(), [](auto& a, auto& b) { return a.radius < b.radius; });
  const std::uint64_t total = samples_of(radii);
  survey.low = quantile(radii, total, kLow);
  survey.median = quantile(radii, total, kMiddle);
  survey.high = quantile(radii, total, kHigh);
  return survey;
}

}  // namespace

RadiusSurvey survey_density(const SlabStore& store, std::uint64_t sample_limit, std::uint32_t min_samples) {
  return survey_density(store, reader_of(store), sample_limit, min_samples);
}

RadiusSurvey survey_radii(const SlabStore& store, std::uint64_t sample_limit, std::uint32_t min_samples) {
  return survey_radii(store, reader_of(store), sample_limit, min_samples);
}

RadiusSurvey survey_radii(const SlabStore& store, const ReadBucket& read, std::uint64_t sample_limit,
                          std::uint32_t min_samples) {
  RadiusSurvey survey = survey_density(store, read, sample_limit, min_samples);
  const Noise noise = survey_noise(store, read, survey.median);
  survey.noise = noise.distance;
  survey.normal_noise = noise.angle;
  survey.high_noise = noise.high;
  survey.blurred = noise.blurred;
  survey.lopsided = noise.lopsided;
  survey.lined = noise.lined;
  survey.worst_noise = noise.worst;
  survey.noisiest = noise.worst_at;
  return survey;
}

}  // namespace lamina

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <span>
#include <utility>

#include "samples/radii.h"
#include "samples/survey_noise.h"

namespace lamina {
namespace {

/// Buckets [begin, end) looked at together.
struct Window {
  std::size_t begin, end;
};

struct WeightedRadius {
  float radius;
  std::uint64_t samples;
};

constexpr int kKeyBits = 21;  ///< per axis: the deepest octree a 64-bit key can tell apart

/// The bits of v, two zeros after each.
std::uint64_t spread_bits(std::uint64_t v) {
  v = (v | v << 32) & 0x001F'0000'0000'FFFFU;
  v = (v | v << 16) & 0x001F'0000'FF00'00FFU;
  v = (v | v << 8) & 0x100F'00F0'0F00'F00FU;
  v = (v | v << 4) & 0x10C3'0C30'C30C'30C3U;
  return (v | v << 2) & 0x1249'2492'4924'9249U;
}

/// The octree of one window over sorted Morton keys: a cell is a run of them.
class Octree {
 public:
  Octree(const LocalSamples& points, Window window, const SlabStore& store, std::uint32_t min_samples)
      : min_samples_(std::max(min_samples, 1U)) {
    std::int64_t extent = 0;
    const std::array arrays{&points.x, &points.y, &points.z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto [low, high] = std::minmax_element(arrays[axis]->begin(), arrays[axis]->end());
      origin_[axis] = *low;
      extent = std::max<std::int64_t>(extent, static_cast<std::int64_t>(*high) - *low);
    }
    if (extent == 0) return;
    while (extent >> shift_ >= std::int64_t{1} << kKeyBits) ++shift_;
    constexpr auto infinity = std::numeric_limits<double>::infinity();
    const auto relative = [&](std::int32_t z) { return static_cast<double>(z) - static_cast<double>(origin_[2]); };
    bottom_ = window.begin == 0 ? -infinity : 0;
    top_ = window.end == store.buckets() ? infinity : relative(*std::max_element(points.z.begin(), points.z.end())) + 1;
    keys_.resize(points.size());
    for (std::size_t i = 0; i < keys_.size(); ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::int64_t offset = static_cast<std::int64_t>((*arrays[axis])[i]) - origin_[axis];
        keys_[i] |= spread_bits(static_cast<std::uint64_t>(offset) >> shift_) << axis;
      }
    }
    tbb::parallel_sort(keys_.begin(), keys_.end());
  }

  /// Radii of all samples of the window.
  void find_radii(std::vector<WeightedRadius>& out) const {
    if (!keys_.empty()) visit(keys_, kKeyBits, out);
  }

 private:
  /// A cell of side 2^height (in shifted steps) with the keys in it.
  void visit(std::span<const std::uint64_t> cell, int height, std::vector<WeightedRadius>& out) const {
    std::uint64_t unrefined = cell.size();
    if (height > 0) {
      const int bit = 3 * (height - 1);
      for (auto rest = cell; !rest.empty();) {
        const std::uint64_t child = rest.front() >> bit;
        const auto end = std::partition_point(rest.begin(), rest.end(), [&](auto key) { return key >> bit == child; });
        const auto size = static_cast<std::size_t>(end - rest.begin());
        if (size >= min_samples_) {
          visit(rest.first(size), height - 1, out);
          unrefined -= size;
        }
        rest = rest.subspan(size);
      }
    }
    if (unrefined == 0) return;
    const double side = std::ldexp(1.0, height + shift_);
    const double z = std::floor(z_of(cell.front()) / side) * side;
    // The surface mostly runs along the sweep axis, so of a cell cut by the window's ends that share of its area is
    // seen.
    const double seen = std::min(z + side, top_) - std::max(z, bottom_);
    out.push_back({static_cast<float>(2 * std::sqrt(side * seen / static_cast<double>(cell.size()))), unrefined});
  }
  /// Height of a key above the origin, in steps.
  [[nodiscard]] double z_of(std::uint64_t key) const {
    std::uint64_t z = 0;
    for (int b = 0; b < kKeyBits; ++b) z |= (key >> (3 * b + 2) & 1U) << b;
    return std::ldexp(static_cast<double>(z), shift_);
  }

  std::uint64_t min_samples_;
  std::array<std::int32_t, 3> origin_{};
  int shift_ = 0;
  double bottom_ = 0, top_ = 0;  ///< of what the window shows, relative to the origin
  std::vector<std::uint64_t> keys_;
};

LocalSamples read_positions(const ReadBucket& read, Window window) {
  LocalSamples all, bucket;
  for (std::size_t b = window.begin; b < window.end; ++b) {
    read(b, bucket);
    all.x.insert(all.x.end(), bucket.x.begin(), bucket.x.end());
    all.y.insert(all.y.end(), bucket.y.begin(), bucket.y.end());
    all.z.insert(all.z.end(), bucket.z.begin(), bucket.z.end());
  }
  return all;
}

/// Samples at the place of another say nothing of the spacing: half a cloud at one place would hide the other half's.
void drop_coincident(LocalSamples& s) {
  std::vector<std::array<std::int32_t, 3>> places(s.size());
  for (std::size_t i = 0; i < places.size(); ++i) places[i] = {s.x[i], s.y[i], s.z[i]};
  tbb::parallel_sort(places.begin(), places.end());
  places.erase(std::unique(places.begin(), places.end()), places.end());
  for (auto* axis : {&s.x, &s.y, &s.z}) axis->resize(places.size());
  for (std::size_t i = 0; i < places.size(); ++i) {
    s.x[i] = places[i][0];
    s.y[i] = places[i][1];
    s.z[i] = places[i][2];
  }
}

std::uint64_t count(const SlabStore& store, Window window) {
  std::uint64_t n = 0;
  for (std::size_t b = window.begin; b < window.end; ++b) n += store.count(b);
  return n;
}

std::uint64_t samples_of(const std::vector<WeightedRadius>& radii) {
  return std::accumulate(radii.begin(), radii.end(), std::uint64_t{0},
                         [](std::uint64_t n, auto& r) { return n + r.samples; });
}

float quantile(const std::vector<WeightedRadius>& sorted, std::uint64_t total, double q) {
  auto left = static_cast<std::uint64_t>(q * static_cast<double>(total - 1));
  for (const auto& [radius, samples] : sorted) {
    if (left < samples) return radius;
    left -= samples;
  }
  return sorted.back().radius;
}

/// The bucket of the sample with this rank.
std::size_t bucket_of_rank(const SlabStore& store, std::uint64_t rank) {
  std::size_t b = 0;
  while (b + 1 < store.buckets() && rank >= store.count(b)) rank -= store.count(b++);
  return b;
}

std::vector<WeightedRadius> density_radii(const SlabStore& store, const ReadBucket& read, Window window,
                                          std::uint32_t min_samples) {
  std::vector<WeightedRadius> radii;
  if (count(store, window) > 0) {
    LocalSamples samples = read_positions(read, window);
    drop_coincident(samples);
    Octree(samples, window, store, min_samples).find_radii(radii);
  }
  std::sort(radii.begin(), radii.end(), [](auto& a, auto& b) { return a.radius < b.radius; });
  return radii;
}

std::vector<WeightedRadius> given_radii(const ReadBucket& read, Window window) {
  std::vector<WeightedRadius> radii;
  LocalSamples bucket;
  for (std::size_t b = window.begin; b < window.end; ++b) {
    read(b, bucket);
    for (const float r : bucket.radius) radii.push_back({r, 1});
  }
  return radii;
}

/// How many buckets make a window tall enough to hold whole cells: 16 times the radius seen in it.
std::size_t window_buckets(const SlabStore& store, const ReadBucket& read, std::uint64_t sample_limit,
                           std::uint32_t min_samples) {
  constexpr double tall = 16;
  const std::size_t middle = bucket_of_rank(store, store.total() / 2);
  for (std::size_t n = 1;; n *= 2) {
    const std::size_t begin = middle - std::min(middle, n / 2);
    const Window window{begin, std::min(store.buckets(), begin + n)};
    const std::uint64_t samples = count(store, window);
    if (samples >= sample_limit || window.end - window.begin == store.buckets()) return n;
    const auto radii = density_radii(store, read, window, min_samples);
    std::int32_t low = std::numeric_limits<std::int32_t>::max();
    std::int32_t high = std::numeric_limits<std::int32_t>::min();
    for (std::size_t b = window.begin; b < window.end; ++b) {
      low = std::min(low, store.z_lower(b));
      high = std::max(high, store.z_upper(b));
    }
    if (!radii.empty() && static_cast<double>(high) - low >= tall * quantile(radii, samples_of(radii), 0.5)) return n;
  }
}

/// Windows of `size` buckets about evenly spaced ranks, as many as the limit allows; they do not overlap.
std::vector<Window> choose_windows(const SlabStore& store, std::uint64_t sample_limit, std::size_t size) {
  if (store.total() <= sample_limit) return {{0, store.buckets()}};
  const double share = static_cast<double>(sample_limit) / static_cast<double>(store.total());
  const double most = static_cast<double>(store.buckets()) / static_cast<double>(size);
  const auto number = static_cast<std::uint64_t>(std::max(1.0, std::floor(share * most)));
  std::vector<Window> windows;
  std::size_t free = 0;
  for (std::uint64_t i = 0; i < number; ++i) {
    const auto rank = static_cast<double>(store.total()) * (static_cast<double>(i) + 0.5) / static_cast<double>(number);
    const std::size_t middle = bucket_of_rank(store, static_cast<std::uint64_t>(rank));
    const std::size_t begin = std::max(free, middle - std::min(middle, size / 2));
    const std::size_t end = std::min(store.buckets(), begin + size);
    if (begin < end) windows.push_back({begin, end});
    free = std::max(free, end);
  }
  return windows;
}

}  // namespace

RadiusSurvey survey_radii(const SlabStore& store, std::uint64_t sample_limit, std::uint32_t min_samples) {
  const ReadBucket read = [&](std::size_t bucket, LocalSamples& out) { store.read(bucket, out); };
  return survey_radii(store, read, sample_limit, min_samples);
}

RadiusSurvey survey_radii(const SlabStore& store, const ReadBucket& read, std::uint64_t sample_limit,
                          std::uint32_t min_samples) {
  RadiusSurvey survey;
  if (store.total() == 0) return survey;
  const bool given = store.layout().has_radius;
  const bool whole = store.total() <= sample_limit;
  const std::size_t size = given || whole ? 1 : window_buckets(store, read, sample_limit, min_samples);
  std::vector<WeightedRadius> radii;
  for (const Window& window : choose_windows(store, sample_limit, size)) {
    const auto found = given ? given_radii(read, window) : density_radii(store, read, window, min_samples);
    radii.insert(radii.end(), found.begin(), found.end());
    survey.samples += count(store, window);
  }
  if (radii.empty()) return survey;
  std::sort(radii.begin(), radii.end(), [](auto& a, auto& b) { return a.radius < b.radius; });
  const std::uint64_t total = samples_of(radii);
  survey.low = quantile(radii, total, 0.01);
  survey.median = quantile(radii, total, 0.5);
  survey.high = quantile(radii, total, 0.99);
  survey.noise = survey_noise(store, read, survey.median);
  return survey;
}

}  // namespace lamina

#include "samples/sampling_survey.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

#include "base/vectors.h"

namespace lamina {
namespace {

constexpr int kKeyBits = 21;  ///< per axis: the deepest octree a 64-bit key can tell apart

/// The bits of v, two zeros after each.
std::uint64_t spread_bits(std::uint64_t v) {
  v = (v | v << 32) & 0x001F'0000'0000'FFFFU;
  v = (v | v << 16) & 0x001F'0000'FF00'00FFU;
  v = (v | v << 8) & 0x100F'00F0'0F00'F00FU;
  v = (v | v << 4) & 0x10C3'0C30'C30C'30C3U;
  return (v | v << 2) & 0x1249'2492'4924'9249U;
}

/// The octree over sorted Morton keys: a cell is a run of them.
class DensityOctree {
 public:
  DensityOctree(const LocalSamples& points, CutEnds cut, std::uint32_t min_samples)
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
    bottom_ = cut.below ? 0 : -infinity;
    top_ = cut.above ? relative(*std::max_element(points.z.begin(), points.z.end())) + 1 : infinity;
    std::vector<Keyed> order(points.size());
    for (std::size_t i = 0; i < order.size(); ++i) {
      order[i] = {0, static_cast<std::uint32_t>(i)};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::int64_t offset = static_cast<std::int64_t>((*arrays[axis])[i]) - origin_[axis];
        order[i].key |= spread_bits(static_cast<std::uint64_t>(offset) >> shift_) << axis;
      }
    }
    std::vector<Keyed> scratch;
    digit_sort(order, scratch, (std::uint64_t{1} << (3 * kKeyBits)) - 1, [](const Keyed& k) { return k.key; });
    take_distinct(points, order);
  }

  /// Radii of all samples.
  void find_radii(std::vector<WeightedRadius>& out) const {
    if (!keys_.empty()) visit(keys_, kKeyBits, out);
  }

 private:
  struct Keyed {
    std::uint64_t key;
    std::uint32_t sample;
  };

  /// Keys of the samples in order. Samples at the place of another say nothing of the spacing: half a cloud at one
  /// place would hide the other half's.
  void take_distinct(const LocalSamples& points, const std::vector<Keyed>& order) {
    keys_.reserve(order.size());
    std::vector<std::array<std::int32_t, 3>> places;  // of one key
    for (std::size_t begin = 0; begin < order.size();) {
      std::size_t end = begin + 1;
      while (end < order.size() && order[end].key == order[begin].key) ++end;
      std::size_t distinct = 1;
      if (end - begin > 1) {
        places.clear();
        for (std::size_t k = begin; k < end; ++k) {
          const std::uint32_t i = order[k].sample;
          places.push_back({points.x[i], points.y[i], points.z[i]});
        }
        std::sort(places.begin(), places.end());
        distinct = static_cast<std::size_t>(std::unique(places.begin(), places.end()) - places.begin());
      }
      keys_.insert(keys_.end(), distinct, order[begin].key);
      begin = end;
    }
  }
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
    // The surface mostly runs along the sweep axis, so of a cell cut by the ends that share of its area is
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
  double bottom_ = 0, top_ = 0;  ///< of what is seen, relative to the origin
  std::vector<std::uint64_t> keys_;
};

}  // namespace

std::uint64_t samples_of(const std::vector<WeightedRadius>& radii) {
  return std::accumulate(radii.begin(), radii.end(), std::uint64_t{0},
                         [](std::uint64_t n, auto& r) { return n + r.samples; });
}

float quantile(const std::vector<WeightedRadius>& sorted, std::uint64_t total, double share) {
  auto left = static_cast<std::uint64_t>(share * static_cast<double>(total - 1));
  for (const auto& [radius, samples] : sorted) {
    if (left < samples) return radius;
    left -= samples;
  }
  return sorted.back().radius;
}

std::vector<WeightedRadius> density_radii(const LocalSamples& samples, CutEnds cut, std::uint32_t min_samples) {
  std::vector<WeightedRadius> radii;
  if (samples.size() > 0) DensityOctree(samples, cut, min_samples).find_radii(radii);
  std::sort(radii.begin(), radii.end(), [](auto& a, auto& b) { return a.radius < b.radius; });
  return radii;
}

}  // namespace lamina

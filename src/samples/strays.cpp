#include "samples/strays.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <utility>

#include "lamina/error.h"
#include "samples/sample_tree.h"
#include "samples/sampling_survey.h"

namespace lamina {
namespace {

constexpr std::uint64_t kSurveyed = 1u << 16;   ///< samples the spacing is taken from
constexpr std::uint64_t kStraySlab = 1u << 17;  ///< samples tested together, at least
/// How far neighbours are looked for, in median density radii (two spacings each).
constexpr double kStrayReach = 12;
/// Where more than this share of all samples goes, others may have been kept by those alone: one more look.
constexpr double kManyStrays = 1e-3;
constexpr int kLooks = 2;

struct Oriented {
  std::vector<std::int32_t> x, y, z;
  std::vector<float> nx, ny, nz;
  std::vector<std::size_t> number;  ///< in its bucket
  [[nodiscard]] std::size_t size() const { return x.size(); }
};

/// The samples of a slab of buckets and of what lies around them, in a tree.
class Neighbourhoods {
 public:
  Neighbourhoods(const SlabStore& store, const KeepMasks& masks, std::int64_t halo)
      : store_(store), masks_(masks), halo_(halo) {}

  /// Goes on to the next slab; false behind the last one.
  bool advance() {
    first_ = end_;
    low_ = std::numeric_limits<std::int64_t>::max();
    high_ = std::numeric_limits<std::int64_t>::min();
    std::uint64_t samples = 0;
    // Tall enough that few samples are looked at for two slabs.
    for (; end_ < store_.buckets() && (samples < kStraySlab || high_ - low_ < 2 * halo_); ++end_) {
      if (store_.count(end_) == 0) continue;
      samples += store_.count(end_);
      low_ = std::min<std::int64_t>(low_, store_.z_lower(end_));
      high_ = std::max<std::int64_t>(high_, store_.z_upper(end_));
    }
    if (samples == 0) return false;
    gather();
    return true;
  }

  [[nodiscard]] const SampleTree& tree() const { return *tree_; }
  [[nodiscard]] const Oriented& samples() const { return samples_; }  ///< by place of the tree
  /// Of the slab itself and not of its surroundings.
  [[nodiscard]] bool is_own(std::size_t place) const { return bucket_[place] >= first_ && bucket_[place] < end_; }
  [[nodiscard]] std::size_t bucket(std::size_t place) const { return bucket_[place]; }
  /// Own, or near enough to be a neighbour of one that is.
  [[nodiscard]] bool is_near(std::size_t place) const {
    return samples_.z[place] >= low_ - halo_ / 2 && samples_.z[place] <= high_ + halo_ / 2;
  }

 private:
  void gather() {
    std::size_t from = first_;
    while (from > 0 && (store_.count(from - 1) == 0 || store_.z_upper(from - 1) >= low_ - halo_)) --from;
    held_.erase(held_.begin(), held_.lower_bound(from));
    Oriented all;
    std::vector<std::size_t> buckets;
    for (std::size_t b = from; b < store_.buckets(); ++b) {
      if (store_.count(b) == 0) continue;
      if (b >= end_ && store_.z_lower(b) > high_ + halo_) break;
      const Oriented& bucket = read(b);
      for (std::size_t i = 0; i < bucket.size(); ++i) {
        if (bucket.z[i] < low_ - halo_ || bucket.z[i] > high_ + halo_ || !masks_[b][bucket.number[i]]) continue;
        all.x.push_back(bucket.x[i]);
        all.y.push_back(bucket.y[i]);
        all.z.push_back(bucket.z[i]);
        all.nx.push_back(bucket.nx[i]);
        all.ny.push_back(bucket.ny[i]);
        all.nz.push_back(bucket.nz[i]);
        all.number.push_back(bucket.number[i]);
        buckets.push_back(b);
      }
    }
    tree_ = std::make_unique<SampleTree>(all.x, all.y, all.z);
    sort(all, buckets);
  }

  /// By place of the tree.
  void sort(const Oriented& all, const std::vector<std::size_t>& buckets) {
    const std::vector<std::uint32_t>& order = tree_->order();
    const auto take = [&](const auto& from, auto& to) {
      to.resize(order.size());
      for (std::size_t i = 0; i < order.size(); ++i) to[i] = from[order[i]];
    };
    take(all.x, samples_.x);
    take(all.y, samples_.y);
    take(all.z, samples_.z);
    take(all.nx, samples_.nx);
    take(all.ny, samples_.ny);
    take(all.nz, samples_.nz);
    take(all.number, samples_.number);
    take(buckets, bucket_);
  }

  const Oriented& read(std::size_t b) {
    const auto [at, is_new] = held_.try_emplace(b);
    Oriented& to = at->second;
    if (!is_new) return to;
    store_.read(b, local_);
    to.number.resize(local_.size());
    for (std::size_t i = 0; i < local_.size(); ++i) to.number[i] = i;
    to.x = local_.x;
    to.y = local_.y;
    to.z = local_.z;
    to.nx = local_.nx;
    to.ny = local_.ny;
    to.nz = local_.nz;
    return to;
  }

  const SlabStore& store_;
  const KeepMasks& masks_;
  std::int64_t halo_;
  std::size_t first_ = 0, end_ = 0;       ///< buckets of the slab
  std::int64_t low_ = 0, high_ = 0;       ///< z of its samples
  std::map<std::size_t, Oriented> held_;  ///< buckets read, while they are wanted
  LocalSamples local_;
  Oriented samples_;
  std::vector<std::size_t> bucket_;
  std::unique_ptr<SampleTree> tree_;
};

/// What is known of each place of a slab's tree.
struct Loneliness {
  std::vector<float> distance;            ///< mean distance to the neighbours; negative: not looked at
  std::vector<std::uint32_t> neighbours;  ///< kStrayNeighbours for each place
  std::vector<std::uint8_t> count;        ///< of them
  std::vector<std::uint8_t> off_surface;
};

bool is_off_surface(const Oriented& s, std::size_t place, const Neighbour* found, std::size_t count) {
  if (count == 0) return true;
  const float limit = kNearPlane * std::sqrt(found[count - 1].squared);
  std::size_t on = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t n = found[i].sample;
    const auto dx = static_cast<float>(s.x[n] - s.x[place]);
    const auto dy = static_cast<float>(s.y[n] - s.y[place]);
    const auto dz = static_cast<float>(s.z[n] - s.z[place]);
    const float off = std::abs(dx * s.nx[place] + dy * s.ny[place] + dz * s.nz[place]);
    const float cosine = std::abs(s.nx[n] * s.nx[place] + s.ny[n] * s.ny[place] + s.nz[n] * s.nz[place]);
    on += off <= limit && cosine > kAlongSurface ? 1 : 0;
  }
  return static_cast<float>(on) < kLeastOnSurface * static_cast<float>(count);
}

Loneliness look_around(const Neighbourhoods& around, float reach) {
  const SampleTree& tree = around.tree();
  const Oriented& samples = around.samples();
  Loneliness out;
  out.distance.assign(tree.size(), -1);
  out.neighbours.resize(tree.size() * kStrayNeighbours);
  out.count.assign(tree.size(), 0);
  out.off_surface.assign(tree.size(), 0);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, tree.leaves(), 64), [&](const auto& range) {
    std::array<Neighbour, SampleTree::kMostInLeaf * kStrayNeighbours> found;
    std::array<std::size_t, SampleTree::kMostInLeaf> counts;
    for (std::size_t leaf = range.begin(); leaf < range.end(); ++leaf) {
      const SampleTree::Places places = tree.places_of(leaf);
      bool near = false;
      for (std::size_t p = places.begin; p < places.end && !near; ++p) near = around.is_near(p);
      if (!near) continue;
      tree.nearest_to_leaf(leaf, kStrayNeighbours, reach * reach, found.data(), counts.data());
      for (std::size_t i = 0; i < places.size(); ++i) {
        const std::size_t p = places.begin + i;
        const Neighbour* const own = found.data() + i * kStrayNeighbours;
        float sum = static_cast<float>(kStrayNeighbours - counts[i]) * reach;  // those not found are at least there
        for (std::size_t k = 0; k < counts[i]; ++k) {
          sum += std::sqrt(own[k].squared);
          out.neighbours[p * kStrayNeighbours + k] = own[k].sample;
        }
        out.count[p] = static_cast<std::uint8_t>(counts[i]);
        out.distance[p] = sum / static_cast<float>(kStrayNeighbours);
        out.off_surface[p] = is_off_surface(samples, p, own, counts[i]) ? 1 : 0;
      }
    }
  });
  return out;
}

/// The median of the same at the neighbours; 0 where there are none.
float usual_distance(const Loneliness& known, std::size_t place) {
  std::array<float, kStrayNeighbours> distances;
  std::size_t n = 0;
  for (std::size_t k = 0; k < known.count[place]; ++k) {
    const float d = known.distance[known.neighbours[place * kStrayNeighbours + k]];
    if (d >= 0) distances[n++] = d;
  }
  if (n == 0) return 0;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(n / 2);
  std::nth_element(distances.begin(), middle, distances.begin() + static_cast<std::ptrdiff_t>(n));
  return *middle;
}

StrayCounts look(const SlabStore& store, float reach, KeepMasks& masks, const RunContext& run) {
  StrayCounts counts;
  const KeepMasks before = masks;
  Neighbourhoods around(store, before, 2 * static_cast<std::int64_t>(reach));
  while (around.advance()) {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    const Loneliness known = look_around(around, reach);
    for (std::size_t p = 0; p < around.tree().size(); ++p) {
      if (!around.is_own(p)) continue;
      const bool lonely = known.distance[p] > kLonely * usual_distance(known, p);
      if (!lonely && known.off_surface[p] == 0) continue;
      masks[around.bucket(p)][around.samples().number[p]] = false;
      ++(lonely ? counts.lonely : counts.off_surface);
    }
  }
  return counts;
}

}  // namespace

StrayCounts drop_strays(const SlabStore& store, KeepMasks& masks, const RunContext& run) {
  const RadiusSurvey radii = survey_radii(store, kSurveyed);
  constexpr double kMostReach = 1 << 28;
  const auto reach = static_cast<float>(std::clamp(kStrayReach * double{radii.median}, 1.0, kMostReach));
  StrayCounts counts;
  for (int i = 0; i < kLooks; ++i) {
    const StrayCounts found = look(store, reach, masks, run);
    counts.lonely += found.lonely;
    counts.off_surface += found.off_surface;
    if (static_cast<double>(found.all()) <= kManyStrays * static_cast<double>(store.total())) break;
  }
  return counts;
}

}  // namespace lamina

#include "samples/outliers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <span>

#include "base/spill_file.h"
#include "lamina/error.h"
#include "samples/neighbour_grid.h"

namespace lamina::clean {
namespace {

constexpr std::uint64_t kOutlierChunk = 1 << 17;  ///< samples looked at together, at least

/// Positions of the samples that are there, bucket by bucket, kept while they are wanted.
class Buckets {
 public:
  Buckets(const SlabStore& store, const KeepMasks& masks) : store_(store), masks_(masks) {}

  const Positions& get(std::size_t bucket) {
    const auto [at, is_new] = held_.try_emplace(bucket);
    if (!is_new) return at->second;
    store_.read(bucket, samples_);
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      if (!masks_[bucket][i]) continue;
      at->second.x.push_back(samples_.x[i]);
      at->second.y.push_back(samples_.y[i]);
      at->second.z.push_back(samples_.z[i]);
    }
    return at->second;
  }
  void forget_before(std::size_t bucket) { held_.erase(held_.begin(), held_.lower_bound(bucket)); }

 private:
  const SlabStore& store_;
  const KeepMasks& masks_;
  std::map<std::size_t, Positions> held_;
  LocalSamples samples_;
};

void append(Positions& to, const Positions& from) {
  to.x.insert(to.x.end(), from.x.begin(), from.x.end());
  to.y.insert(to.y.end(), from.y.begin(), from.y.end());
  to.z.insert(to.z.end(), from.z.begin(), from.z.end());
}

/// Cells that hold about a third of the neighbours, so that the cells around a sample hold all of them; by runs of
/// buckets from all over the cloud.
std::int32_t choose_cell(const SlabStore& store, Buckets& buckets, std::uint32_t neighbours) {
  constexpr std::size_t kRuns = 8;
  Positions some;
  std::size_t next = 0;
  for (std::size_t run = 0; run < kRuns; ++run) {
    const std::size_t limit = (run + 1) * kOutlierChunk / kRuns * 2;
    for (next = std::max(next, run * store.buckets() / kRuns); next < store.buckets() && some.size() < limit; ++next)
      append(some, buckets.get(next));
    buckets.forget_before(next);
  }
  return counting_cell(some, std::max(2.0, neighbours / 3.0));
}

/// Sums of the mean distances, in the order of the samples.
struct Moments {
  double count = 0, sum = 0, squares = 0;
  void add(const std::vector<float>& values) {
    for (const float v : values) {
      sum += double{v};
      squares += double{v} * double{v};
    }
    count += static_cast<double>(values.size());
  }
  [[nodiscard]] double limit(double sigma) const {
    const double mean = sum / count;
    return mean + sigma * std::sqrt(std::max(0.0, squares / count - mean * mean));
  }
};

}  // namespace

Outliers drop_outliers(const SlabStore& store, const OutlierRule& rule, const std::string& directory, KeepMasks& masks,
                       const RunContext& run) {
  Buckets buckets(store, masks);
  const std::int32_t cell = choose_cell(store, buckets, rule.neighbours);
  buckets.forget_before(store.buckets());
  const std::int64_t reach = std::int64_t{kFarthestCells} * cell;
  SpillFile distances(directory);
  Moments moments;
  for (std::size_t first = 0; first < store.buckets();) {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    std::int64_t low = std::numeric_limits<std::int64_t>::max();
    std::int64_t high = std::numeric_limits<std::int64_t>::min();
    Positions positions;
    std::size_t end = first;
    // Tall enough that few samples are looked at as neighbours of two chunks.
    for (; end < store.buckets() && (positions.size() < kOutlierChunk || high - low < 2 * reach); ++end) {
      if (store.count(end) == 0) continue;
      append(positions, buckets.get(end));
      low = std::min<std::int64_t>(low, store.z_lower(end));
      high = std::max<std::int64_t>(high, store.z_upper(end));
    }
    const std::size_t wanted = positions.size();
    std::size_t below = first;
    while (below > 0 && (store.count(below - 1) == 0 || store.z_upper(below - 1) >= low - reach)) --below;
    buckets.forget_before(below);
    for (std::size_t b = below; b < first; ++b) {
      if (store.count(b) > 0) append(positions, buckets.get(b));
    }
    for (std::size_t b = end; b < store.buckets() && (store.count(b) == 0 || store.z_lower(b) <= high + reach); ++b) {
      if (store.count(b) > 0) append(positions, buckets.get(b));
    }
    const std::vector<float> means = mean_distances(positions, wanted, rule.neighbours, cell);
    moments.add(means);
    distances.append(std::as_bytes(std::span(means)));
    first = end;
  }
  distances.flush();
  Outliers out;
  if (!(moments.count > 0)) return out;
  out.limit = moments.limit(rule.sigma);
  std::vector<float> means;
  std::uint64_t at = 0;
  for (auto& mask : masks) {
    means.resize(static_cast<std::size_t>(std::count(mask.begin(), mask.end(), true)));
    const auto bytes = std::as_writable_bytes(std::span(means));
    distances.read(at, bytes);
    at += bytes.size();
    std::size_t n = 0;
    for (auto&& stays : mask) {
      if (!stays || !(double{means[n++]} > out.limit)) continue;
      stays = false;
      ++out.count;
    }
  }
  return out;
}

}  // namespace lamina::clean

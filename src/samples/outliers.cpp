#include "samples/cleaning.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <span>

#include "base/spill_file.h"
#include "lamina/error.h"

namespace lamina {
namespace {

constexpr int kBits =
    21;  ///< of a cell's coordinate: fixed-point coordinates lie within +-2^30, cells are 2^10 or more
constexpr std::int64_t kOrigin = 1 << (kBits - 1);
/// Cells to either side that are looked at, until the neighbours found are certain to be the nearest.
constexpr std::array<int, 4> kHalos{1, 2, 3, kFarthestCells};

using CellAt = std::array<std::int64_t, 3>;

std::uint64_t key_of(const CellAt& c) {
  constexpr std::int64_t kLast = (std::int64_t{1} << kBits) - 1;
  std::uint64_t key = 0;
  for (std::size_t k = 3; k-- > 0;)
    key = key << kBits | static_cast<std::uint64_t>(std::clamp<std::int64_t>(c[k], 0, kLast));
  return key;
}

CellAt cell_at(std::uint64_t key) {
  constexpr std::uint64_t kMask = (std::uint64_t{1} << kBits) - 1;
  CellAt c;
  for (std::size_t k = 0; k < 3; ++k) c[k] = static_cast<std::int64_t>(key >> (kBits * k) & kMask);
  return c;
}

std::uint64_t key_at(const Positions& p, std::size_t i, std::int32_t cell) {
  const auto along = [&](std::int32_t v) {
    return (v / cell) - static_cast<std::int64_t>(v % cell != 0 && v < 0) + kOrigin;
  };
  return key_of({along(p.x[i]), along(p.y[i]), along(p.z[i])});
}

struct NeighbourEntry {
  std::uint64_t key;
  std::uint32_t index;
  auto operator<=>(const NeighbourEntry&) const = default;
};

class Grid {
 public:
  Grid(const Positions& positions, std::int32_t cell) : entries_(positions.size()) {
    tbb::parallel_for(std::size_t{0}, entries_.size(), [&](std::size_t i) {
      entries_[i] = {key_at(positions, i, cell), static_cast<std::uint32_t>(i)};
    });
    tbb::parallel_sort(entries_.begin(), entries_.end());
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      if (i == 0 || entries_[i].key != entries_[i - 1].key) firsts_.push_back(i);
    }
  }

  [[nodiscard]] std::size_t cells() const { return firsts_.size(); }
  [[nodiscard]] std::span<const NeighbourEntry> members(std::size_t cell) const {
    const std::size_t end = cell + 1 < firsts_.size() ? firsts_[cell + 1] : entries_.size();
    return {entries_.data() + firsts_[cell], entries_.data() + end};
  }

  /// Indices of all positions at most `halo` cells away along every axis.
  void gather(std::uint64_t key, int halo, std::vector<std::uint32_t>& out) const {
    out.clear();
    const CellAt c = cell_at(key);
    for (std::int64_t z = c[2] - halo; z <= c[2] + halo; ++z) {
      for (std::int64_t y = c[1] - halo; y <= c[1] + halo; ++y) {
        const std::uint64_t last = key_of({c[0] + halo, y, z});
        auto at = std::lower_bound(entries_.begin(), entries_.end(), key_of({c[0] - halo, y, z}),
                                   [](const NeighbourEntry& e, std::uint64_t k) { return e.key < k; });
        for (; at != entries_.end() && at->key <= last; ++at) out.push_back(at->index);
      }
    }
  }

 private:
  std::vector<NeighbourEntry> entries_;
  std::vector<std::size_t> firsts_;  ///< of the entries of each occupied cell
};

/// The positions among which neighbours are looked for, one after the other in memory.
class Candidates {
 public:
  Candidates(const Positions& positions, std::uint32_t neighbours, std::int32_t cell)
      : positions_(positions), neighbours_(neighbours), cell_(static_cast<float>(cell)) {}

  /// Those at most `halo` cells from the cell of `key`.
  void gather(const Grid& grid, std::uint64_t key, int halo) {
    grid.gather(key, halo, indices_);
    halo_ = halo;
    for (auto* values : {&x_, &y_, &z_}) values->resize(indices_.size());
    squares_.resize(indices_.size());
    for (std::size_t j = 0; j < indices_.size(); ++j) {
      x_[j] = positions_.x[indices_[j]];
      y_[j] = positions_.y[indices_[j]];
      z_[j] = positions_.z[indices_[j]];
    }
  }

  /// The mean distance of sample i, which is one of them; negative when nearer neighbours may lie beyond.
  float mean_distance(std::uint32_t i) {
    // Differences of 32 bits, several at a time: coordinates lie within +-2^30, and neighbours near each other.
    const std::int32_t x = positions_.x[i];
    const std::int32_t y = positions_.y[i];
    const std::int32_t z = positions_.z[i];
    for (std::size_t j = 0; j < squares_.size(); ++j) {
      const auto dx = static_cast<float>(x_[j] - x);
      const auto dy = static_cast<float>(y_[j] - y);
      const auto dz = static_cast<float>(z_[j] - z);
      squares_[j] = dx * dx + dy * dy + dz * dz;
    }
    // One of the zeros is the sample itself.
    const std::size_t found = std::min<std::size_t>(neighbours_, squares_.size() - 1);
    std::nth_element(squares_.begin(), squares_.begin() + static_cast<std::ptrdiff_t>(found), squares_.end());
    const float certain = static_cast<float>(halo_) * cell_;
    const bool complete = found == neighbours_ && squares_[found] <= certain * certain;
    if (!complete && halo_ < kFarthestCells) return -1;
    double sum = static_cast<double>(neighbours_ - found) * double{certain};
    for (std::size_t k = 0; k <= found; ++k) sum += double{std::min(certain, std::sqrt(squares_[k]))};
    return static_cast<float>(sum / neighbours_);
  }

 private:
  const Positions& positions_;
  std::uint32_t neighbours_;
  float cell_;
  int halo_ = 0;
  std::vector<std::uint32_t> indices_;
  std::vector<std::int32_t> x_, y_, z_;
  std::vector<float> squares_;
};

}  // namespace

std::vector<float> mean_distances(const Positions& positions, std::size_t wanted, std::uint32_t neighbours,
                                  std::int32_t cell) {
  std::vector<float> means(wanted);
  const Grid grid(positions, cell);
  constexpr std::size_t kGrain = 64;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, grid.cells(), kGrain), [&](const auto& range) {
    Candidates candidates(positions, neighbours, cell);
    std::vector<std::uint32_t> open;
    for (std::size_t c = range.begin(); c < range.end(); ++c) {
      open.clear();
      for (const NeighbourEntry& e : grid.members(c)) {
        if (e.index < wanted) open.push_back(e.index);
      }
      for (const int halo : kHalos) {
        if (open.empty()) break;
        candidates.gather(grid, grid.members(c).front().key, halo);
        std::erase_if(open, [&](std::uint32_t i) { return (means[i] = candidates.mean_distance(i)) >= 0; });
      }
    }
  });
  return means;
}

std::int32_t counting_cell(const Positions& positions, double wanted) {
  constexpr int kFinest = 20;  // half octaves
  constexpr int kCoarsest = 56;
  std::vector<std::uint64_t> keys(positions.size());
  for (int size = kFinest; size < kCoarsest; ++size) {
    const auto cell = static_cast<std::int32_t>(std::lrint(std::exp2(0.5 * size)));
    for (std::size_t i = 0; i < keys.size(); ++i) keys[i] = key_at(positions, i, cell);
    std::sort(keys.begin(), keys.end());
    const auto cells = std::unique(keys.begin(), keys.end()) - keys.begin();
    if (static_cast<double>(positions.size()) >= wanted * static_cast<double>(cells)) return cell;
  }
  return 1 << (kCoarsest / 2);
}

namespace {

constexpr std::uint64_t kOutlierChunk = 1 << 17;  ///< samples looked at together, at least
/// A cell holds one part in so many of the neighbours looked for: nine cells of a surface around a sample hold them all
/// mostly.
constexpr double kNeighboursPerCell = 3;

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

/// Cells for so many neighbours, by runs of buckets from all over the cloud.
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
  return counting_cell(some, std::max(2.0, neighbours / kNeighboursPerCell));
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

/// Goes up the store in chunks, each with the samples around it that are neighbours of its own.
class ChunkSweep {
 public:
  ChunkSweep(const SlabStore& store, Buckets& buckets, std::int64_t halo)
      : store_(store), buckets_(buckets), halo_(halo) {}

  [[nodiscard]] bool done() const { return next_ == store_.buckets(); }
  /// The next chunk's samples first, `own` of them, then their surroundings'.
  Positions take(std::size_t& own) {
    std::int64_t low = std::numeric_limits<std::int64_t>::max();
    std::int64_t high = std::numeric_limits<std::int64_t>::min();
    Positions positions;
    const std::size_t first = next_;
    // Tall enough that few samples are looked at as neighbours of two chunks.
    for (; !done() && (positions.size() < kOutlierChunk || high - low < 2 * halo_); ++next_) {
      if (store_.count(next_) == 0) continue;
      append(positions, buckets_.get(next_));
      low = std::min<std::int64_t>(low, store_.z_lower(next_));
      high = std::max<std::int64_t>(high, store_.z_upper(next_));
    }
    own = positions.size();
    std::size_t below = first;
    while (below > 0 && (store_.count(below - 1) == 0 || store_.z_upper(below - 1) >= low - halo_)) --below;
    buckets_.forget_before(below);
    for (std::size_t b = below; b < first; ++b) {
      if (store_.count(b) > 0) append(positions, buckets_.get(b));
    }
    for (std::size_t b = next_; b < store_.buckets() && (store_.count(b) == 0 || store_.z_lower(b) <= high + halo_);
         ++b) {
      if (store_.count(b) > 0) append(positions, buckets_.get(b));
    }
    return positions;
  }

 private:
  const SlabStore& store_;
  Buckets& buckets_;
  std::int64_t halo_;
  std::size_t next_ = 0;  ///< bucket
};

/// Clears the masks of samples farther than the limit from their neighbours, by their mean distances in the order of
/// the masks. Returns how many.
std::uint64_t drop_beyond(double limit, const SpillFile& distances, KeepMasks& masks) {
  std::uint64_t dropped = 0;
  std::vector<float> means;
  std::uint64_t at = 0;
  for (auto& mask : masks) {
    means.resize(static_cast<std::size_t>(std::count(mask.begin(), mask.end(), true)));
    const auto bytes = std::as_writable_bytes(std::span(means));
    distances.read(at, bytes);
    at += bytes.size();
    std::size_t n = 0;
    for (auto&& stays : mask) {
      if (!stays || !(double{means[n++]} > limit)) continue;
      stays = false;
      ++dropped;
    }
  }
  return dropped;
}

}  // namespace

Outliers drop_outliers(const SlabStore& store, const OutlierRule& rule, const std::string& directory, KeepMasks& masks,
                       const RunContext& run) {
  Buckets buckets(store, masks);
  const std::int32_t cell = choose_cell(store, buckets, rule.neighbours);
  buckets.forget_before(store.buckets());
  SpillFile distances(directory);
  Moments moments;
  ChunkSweep sweep(store, buckets, std::int64_t{kFarthestCells} * cell);
  while (!sweep.done()) {
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    std::size_t own = 0;
    const Positions positions = sweep.take(own);
    const std::vector<float> means = mean_distances(positions, own, rule.neighbours, cell);
    moments.add(means);
    distances.append(std::as_bytes(std::span(means)));
  }
  distances.flush();
  Outliers out;
  if (!(moments.count > 0)) return out;
  out.limit = moments.limit(rule.sigma);
  out.count = drop_beyond(out.limit, distances, masks);
  return out;
}

}  // namespace lamina

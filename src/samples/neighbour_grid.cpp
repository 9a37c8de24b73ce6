#include "samples/neighbour_grid.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

namespace lamina::clean {
namespace {

constexpr int kBits =
    21;  ///< of a cell's coordinate: fixed-point coordinates lie within +-2^30, cells are 2^10 or more
constexpr std::int64_t kOrigin = 1 << (kBits - 1);
/// Cells to either side that are looked at, until the neighbours found are certain to be the nearest.
constexpr std::array<int, 4> kReaches{1, 2, 3, kFarthestCells};

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

  /// Indices of all positions at most `reach` cells away along every axis.
  void gather(std::uint64_t key, int reach, std::vector<std::uint32_t>& out) const {
    out.clear();
    const CellAt c = cell_at(key);
    for (std::int64_t z = c[2] - reach; z <= c[2] + reach; ++z) {
      for (std::int64_t y = c[1] - reach; y <= c[1] + reach; ++y) {
        const std::uint64_t last = key_of({c[0] + reach, y, z});
        auto at = std::lower_bound(entries_.begin(), entries_.end(), key_of({c[0] - reach, y, z}),
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

  /// Those at most `reach` cells from the cell of `key`.
  void gather(const Grid& grid, std::uint64_t key, int reach) {
    grid.gather(key, reach, indices_);
    reach_ = reach;
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
    const float certain = static_cast<float>(reach_) * cell_;
    const bool complete = found == neighbours_ && squares_[found] <= certain * certain;
    if (!complete && reach_ < kFarthestCells) return -1;
    double sum = static_cast<double>(neighbours_ - found) * double{certain};
    for (std::size_t k = 0; k <= found; ++k) sum += double{std::min(certain, std::sqrt(squares_[k]))};
    return static_cast<float>(sum / neighbours_);
  }

 private:
  const Positions& positions_;
  std::uint32_t neighbours_;
  float cell_;
  int reach_ = 0;
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
      for (const int reach : kReaches) {
        if (open.empty()) break;
        candidates.gather(grid, grid.members(c).front().key, reach);
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

}  // namespace lamina::clean

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <tuple>

#include "mls/sample_clusters.h"

namespace lamina {
namespace {

struct Entry {
  std::uint32_t tile;
  std::uint32_t cluster;
};

std::int32_t ceil_cell(double x) {
  return static_cast<std::int32_t>(std::ceil(x));
}
std::int32_t floor_cell(double x) {
  return static_cast<std::int32_t>(std::floor(x));
}

/// Finds tiles by their block: in a dense table of their box where that is not much larger than their number.
class TileTable {
 public:
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};

  explicit TileTable(std::span<const Block> tiles) : tiles_(tiles) {
    if (tiles.empty()) return;
    low_ = high_ = tiles.front();
    for (const Block& b : tiles) {
      low_ = {std::min(low_.x, b.x), std::min(low_.y, b.y), std::min(low_.z, b.z)};
      high_ = {std::max(high_.x, b.x), std::max(high_.y, b.y), std::max(high_.z, b.z)};
    }
    nx_ = std::int64_t{high_.x} - low_.x + 1;
    ny_ = std::int64_t{high_.y} - low_.y + 1;
    const double volume = static_cast<double>(nx_) * static_cast<double>(ny_) * (1.0 + high_.z - low_.z);
    if (volume > 4096 + 256.0 * static_cast<double>(tiles.size())) return;
    numbers_.assign(static_cast<std::size_t>(volume), kNone);
    for (std::size_t t = 0; t < tiles.size(); ++t) numbers_[place(tiles[t])] = static_cast<std::uint32_t>(t);
  }
  [[nodiscard]] std::uint32_t find(const Block& b) const {
    if (b.x < low_.x || b.y < low_.y || b.z < low_.z || b.x > high_.x || b.y > high_.y || b.z > high_.z) return kNone;
    if (!numbers_.empty()) return numbers_[place(b)];
    const auto key = [](const Block& k) { return std::tuple(k.z, k.y, k.x); };
    const auto at = std::lower_bound(tiles_.begin(), tiles_.end(), b,
                                     [&](const Block& l, const Block& r) { return key(l) < key(r); });
    return at != tiles_.end() && *at == b ? static_cast<std::uint32_t>(at - tiles_.begin()) : kNone;
  }

 private:
  [[nodiscard]] std::size_t place(const Block& b) const {
    return static_cast<std::size_t>(((b.z - low_.z) * ny_ + (b.y - low_.y)) * nx_ + (b.x - low_.x));
  }

  std::span<const Block> tiles_;
  Block low_{0, 0, 0}, high_{-1, -1, -1};
  std::int64_t nx_ = 0, ny_ = 0;
  std::vector<std::uint32_t> numbers_;
};

/// Lattice points of an axis that a cluster reaches.
struct Points {
  std::int32_t first, last;
};

Points points_of(const SampleCluster& c, int axis, const QueryLayers& layers, double inv) {
  const double low = (double{static_cast<double>(c.low[axis])} - static_cast<double>(layers.margin)) * inv;
  const double high = (double{static_cast<double>(c.high[axis])} + static_cast<double>(layers.margin)) * inv;
  return {ceil_cell(low - static_cast<double>(layers.shift)), floor_cell(high - static_cast<double>(layers.shift))};
}

/// Some clusters of a bucket with the tiles they reach.
struct Bin {
  const ClusteredBucket* bucket;
  std::uint32_t begin, end;  ///< clusters
  std::vector<Entry> entries;
};

void find_tiles(const Lattice& lattice, const QueryLayers& layers, std::span<const Block> tiles, const TileTable& table,
                Bin& bin) {
  const double inv = 1.0 / lattice.cell_size(layers.level);
  std::vector<Entry>& out = bin.entries;
  for (std::uint32_t i = bin.begin; i < bin.end; ++i) {
    const SampleCluster& c = bin.bucket->clusters[i];
    const Points z = points_of(c, 2, layers, inv);
    const std::int32_t z0 = std::max(z.first, layers.first);
    const std::int32_t z1 = std::min(z.last, layers.end - 1);
    if (z0 > z1) continue;
    const Points x = points_of(c, 0, layers, inv);
    const Points y = points_of(c, 1, layers, inv);
    const Block low{x.first >> 3, y.first >> 3, z0 >> 3};
    const Block high{x.last >> 3, y.last >> 3, z1 >> 3};
    // A support far larger than a tile reaches more places than there are tiles.
    if ((double{1} + high.x - low.x) * (double{1} + high.y - low.y) > static_cast<double>(tiles.size())) {
      for (std::uint32_t t = 0; t < tiles.size(); ++t) {
        const Block& b = tiles[t];
        if (b.x < low.x || b.x > high.x || b.y < low.y || b.y > high.y || b.z < low.z || b.z > high.z) continue;
        out.push_back({t, i});
      }
      continue;
    }
    for (std::int32_t bz = low.z; bz <= high.z; ++bz) {
      for (std::int32_t by = low.y; by <= high.y; ++by) {
        for (std::int32_t bx = low.x; bx <= high.x; ++bx) {
          const std::uint32_t tile = table.find({bx, by, bz});
          if (tile != TileTable::kNone) out.push_back({tile, i});
        }
      }
    }
  }
}

}  // namespace

TileRuns bin_clusters(const Lattice& lattice, const QueryLayers& layers, const ClusteredBatch& batch,
                      std::span<const Block> tiles) {
  const TileTable table(tiles);
  constexpr std::uint32_t kClusters = 1024;  // so few of a bucket that all threads have work
  std::vector<Bin> bins;
  for (const auto& bucket : batch) {
    const auto all = static_cast<std::uint32_t>(bucket->clusters.size());
    for (std::uint32_t begin = 0; begin < all; begin += kClusters)
      bins.push_back({bucket.get(), begin, std::min(begin + kClusters, all), {}});
  }
  tbb::parallel_for(std::size_t{0}, bins.size(),
                    [&](std::size_t b) { find_tiles(lattice, layers, tiles, table, bins[b]); });
  TileRuns out;
  out.begin.assign(tiles.size() + 1, 0);
  for (const Bin& bin : bins) {
    for (const Entry& e : bin.entries) ++out.begin[e.tile + 1];
  }
  for (std::size_t t = 0; t < tiles.size(); ++t) out.begin[t + 1] += out.begin[t];
  out.runs.resize(out.begin.back());
  std::vector<std::uint32_t> cursor(out.begin.begin(), out.begin.end() - 1);
  for (const Bin& bin : bins) {
    for (const Entry& e : bin.entries) {
      const SampleCluster& c = bin.bucket->clusters[e.cluster];
      out.runs[cursor[e.tile]++] = {bin.bucket, c.begin, c.end};
    }
  }
  return out;
}

}  // namespace lamina

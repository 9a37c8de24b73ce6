#include "mls/tile_samples.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <tuple>

#include "base/vectors.h"

namespace lamina {
namespace {

constexpr std::int32_t kMost = std::numeric_limits<std::int32_t>::max();
constexpr std::int32_t kLeast = std::numeric_limits<std::int32_t>::min();

/// Edge of a cluster's cube in cells. Smaller ones fit tiles more closely but are more.
constexpr int kClusterCells = 4;

/// More cubes than this in a level are joined to larger ones, so that their numbers stay small.
constexpr double kMostCubes = 1e12;

using Keyed = ClusterScratch::Keyed;

/// Cubes of a level that the bucket covers, numbered z, y, x.
struct Cubes {
  std::array<std::int32_t, 3> origin{};
  std::array<std::uint64_t, 3> count{};
  std::int32_t edge = 1;
  std::uint64_t first = 0;  ///< number of the first

  [[nodiscard]] std::uint64_t number(std::int32_t x, std::int32_t y, std::int32_t z) const {
    const auto at = [&](std::int32_t v, int axis) {
      return static_cast<std::uint64_t>((static_cast<std::uint32_t>(v) - static_cast<std::uint32_t>(origin[axis])) /
                                        static_cast<std::uint32_t>(edge));
    };
    return first + (at(z, 2) * count[1] + at(y, 1)) * count[0] + at(x, 0);
  }
};

std::vector<Cubes> cubes_of(const LocalSamples& s, const Lattice& lattice) {
  const auto [x0, x1] = std::minmax_element(s.x.begin(), s.x.end());
  const auto [y0, y1] = std::minmax_element(s.y.begin(), s.y.end());
  const auto [z0, z1] = std::minmax_element(s.z.begin(), s.z.end());
  const std::array<std::int32_t, 3> low{*x0, *y0, *z0};
  const std::array<std::int32_t, 3> high{*x1, *y1, *z1};
  std::vector<Cubes> cubes(static_cast<std::size_t>(lattice.levels));
  std::uint64_t first = 0;
  for (int level = 0; level < lattice.levels; ++level) {
    Cubes& c = cubes[static_cast<std::size_t>(level)];
    // Cubes of huge cells would pass the range of an int; one holds everything then.
    c.edge = std::min(lattice.cell_size(level), kMost / kClusterCells) * kClusterCells;
    c.first = first;
    const auto set = [&](std::int32_t edge) {
      c.edge = edge;
      double all = 1;
      for (int axis = 0; axis < 3; ++axis) {
        // Aligned with the lattice, so that a cube never straddles more tiles than it must.
        const std::int64_t origin = std::int64_t{floor_div(low[axis], edge)} * edge;
        c.origin[axis] = static_cast<std::int32_t>(std::max<std::int64_t>(origin, kLeast));
        c.count[axis] = static_cast<std::uint64_t>((std::int64_t{high[axis]} - c.origin[axis]) / edge + 1);
        all *= static_cast<double>(c.count[axis]);
      }
      return all;
    };
    while (set(c.edge) > kMostCubes && c.edge <= kMost / 2) c.edge *= 2;
    first += c.count[0] * c.count[1] * c.count[2];
  }
  return cubes;
}

/// The samples that count, by cube.
const std::vector<Keyed>& in_order(const ActiveBucket& bucket, const Lattice& lattice, ClusterScratch& scratch) {
  const LocalSamples& s = bucket.samples;
  std::vector<Keyed>& keyed = scratch.keyed;
  keyed.clear();
  if (s.size() == 0) return keyed;
  keyed.reserve(s.size());
  const std::vector<Cubes> cubes = cubes_of(s, lattice);
  for (std::size_t i = 0; i < s.size(); ++i) {
    if (bucket.support[i] <= 0) continue;
    keyed.push_back({cubes[bucket.level[i]].number(s.x[i], s.y[i], s.z[i]), static_cast<std::uint32_t>(i)});
  }
  const Cubes& last = cubes.back();
  digit_sort(keyed, scratch.other, last.first + last.count[0] * last.count[1] * last.count[2],
             [](const Keyed& k) { return k.key; });
  return keyed;
}

void pick(const std::vector<float>& from, const std::vector<Keyed>& order, std::vector<float>& out) {
  resize_anew(out, order.size());
  for (std::size_t k = 0; k < order.size(); ++k) out[k] = from[order[k].sample];
}

std::int32_t bounded(double steps) {
  return static_cast<std::int32_t>(std::clamp(steps, double{kLeast}, double{kMost}));
}

/// Widens the cluster's box by a sample's support.
void include(const ClusterSample& s, SampleCluster& c) {
  const double radius = static_cast<double>(s.support);
  const std::array<std::int32_t, 3> p{s.x, s.y, s.z};
  for (int axis = 0; axis < 3; ++axis) {
    c.low[axis] = std::min(c.low[axis], bounded(std::floor(p[axis] - radius)));
    c.high[axis] = std::max(c.high[axis], bounded(std::ceil(p[axis] + radius)));
  }
}

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

typedef std::uint32_t FourWords __attribute__((vector_size(16)));  // NOLINT(modernize-use-using)

std::uint32_t word(std::int32_t v) {
  return static_cast<std::uint32_t>(v);
}

/// How far a sample lies from a place, in steps; the fourth number is anything. In integers: exact however far both lie
/// from the frame's origin.
FourInts from_origin(const ClusterSample& s, const FourWords& origin) {
  FourWords at;
  static_assert(offsetof(ClusterSample, y) == 4 && offsetof(ClusterSample, z) == 8);
  std::memcpy(&at, &s, sizeof(at));
  return std::bit_cast<FourInts>(at - origin);
}

/// Asks for the samples of a run, which lie anywhere in memory, before they are looked at. Always inlined: the compiler
/// takes a function that does nothing else for one without effect.
[[gnu::always_inline]] inline void ask_for(const Run& run) {
  constexpr std::size_t kLine = 64;  // bytes
  const ClusterSample* const samples = run.from->samples.data();
  const char* const end = reinterpret_cast<const char*>(samples + run.end);
  for (const char* at = reinterpret_cast<const char*>(samples + run.begin); at < end; at += kLine)
    __builtin_prefetch(at);
}

/// The row of cells that a sample lies in. By the very coordinates the sums use: what ranges() cuts off lies beyond the
/// support in these, too.
std::int32_t row_of(const FourFloats& at) {
  const FourFloats zero{};
  const FourFloats last = zero + static_cast<float>(RowSamples::kRows - 1);
  FourFloats row = floor_of(at) - static_cast<float>(RowSamples::kLow);
  row = row > zero ? row : zero;
  const FourInts place = __builtin_convertvector(row < last ? row : last, FourInts);
  return place[2] * RowSamples::kRows + place[1];
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

void cluster_samples(const ActiveBucket& bucket, const Lattice& lattice, ClusterScratch& scratch,
                     ClusteredBucket& out) {
  const std::vector<Keyed>& order = in_order(bucket, lattice, scratch);
  const LocalSamples& s = bucket.samples;
  resize_anew(out.samples, order.size());
  for (std::size_t k = 0; k < order.size(); ++k) {
    const std::uint32_t i = order[k].sample;
    out.samples[k] = {s.x[i],  s.y[i],  s.z[i],           bucket.support[i], s.nx[i],
                      s.ny[i], s.nz[i], bucket.weight[i], bucket.band[i]};
  }
  out.attributes.resize(s.attributes.size() + (bucket.residual.empty() ? 0 : kResidualSums));
  for (std::size_t a = 0; a < s.attributes.size(); ++a) pick(s.attributes[a], order, out.attributes[a]);
  if (!bucket.residual.empty()) {
    pick(bucket.residual, order, out.attributes.end()[-2]);
    out.attributes.back().resize(order.size());
    std::transform(out.attributes.end()[-2].begin(), out.attributes.end()[-2].end(), out.attributes.back().begin(),
                   [](float r) { return r * r; });
  }
  out.clusters.clear();
  for (std::size_t k = 0; k < order.size(); ++k) {
    if (k == 0 || order[k].key != order[k - 1].key) {
      if (k > 0) out.clusters.back().end = static_cast<std::uint32_t>(k);
      out.clusters.push_back({static_cast<std::uint32_t>(k), 0, {kMost, kMost, kMost}, {kLeast, kLeast, kLeast}});
    }
    include(out.samples[k], out.clusters.back());
  }
  if (!order.empty()) out.clusters.back().end = static_cast<std::uint32_t>(order.size());
}

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

void RowSamples::gather(const Lattice& lattice, const QueryLayers& layers, const Block& block,
                        std::span<const Run> runs) {
  select(lattice, layers, block, runs);
  place(lattice, layers.level, runs);
}

void RowSamples::select(const Lattice& lattice, const QueryLayers& layers, const Block& block,
                        std::span<const Run> runs) {
  const std::int32_t a = lattice.cell_size(layers.level);
  const float inv = 1.0F / static_cast<float>(a);
  const FourWords origin = FourWords{word(block.x), word(block.y), word(block.z), 0} * (8U * word(a));
  // Points of the block: their middle, and how far they lie from it at most, rounding included.
  const float margin = layers.margin * inv + 1e-4F;
  const auto z_first = static_cast<float>(std::max(layers.first - block.z * 8, 0)) + layers.shift;
  const auto z_last = static_cast<float>(std::min(layers.end - 1 - block.z * 8, 7)) + layers.shift;
  const float half = 3.5F + margin;
  const FourFloats middle{3.5F + layers.shift, 3.5F + layers.shift, 0.5F * (z_first + z_last), 0};
  const FourFloats reach{half, half, 0.5F * (z_last - z_first) + margin, 0};

  std::size_t n = 0;
  for (std::uint32_t r = 0; r < runs.size(); ++r) {
    if (r + 1 < runs.size()) ask_for(runs[r + 1]);
    const std::size_t count = runs[r].end - runs[r].begin;
    if (n + count > found_.size()) found_.resize(2 * found_.size() + count);
    for (const ClusterSample& s : std::span(runs[r].from->samples).subspan(runs[r].begin, count)) {
      FourFloats at = to_floats(from_origin(s, origin)) * inv;
      const float support = s.support * inv;
      const FourFloats off = at - middle;
      const bool keep = (bits_of((off > -off ? off : -off) <= reach + support) & 7U) == 7U;
      at[3] = support;
      found_[n] = {at, &s, row_of(at), r};
      n += keep ? 1 : 0;
    }
  }
  count_ = n;
}

void RowSamples::place(const Lattice& lattice, int level, std::span<const Run> runs) {
  const float inv = 1.0F / static_cast<float>(lattice.cell_size(level));
  const std::size_t attributes = runs.empty() ? 0 : runs.front().from->attributes.size();
  // Longer than that they may stay: what lies behind the ranges is not looked at.
  if (samples_.all.size() < count_ || samples_.attributes.size() != attributes) samples_.resize(count_, attributes);
  const std::span<const Found> found(found_.data(), count_);
  row_begin_.assign(kRows * kRows + 1, 0);
  for (const Found& f : found) ++row_begin_[static_cast<std::size_t>(f.row) + 1];
  for (std::size_t r = 0; r < kRows * kRows; ++r) row_begin_[r + 1] += row_begin_[r];
  std::array<std::uint32_t, kRows * kRows> cursor{};
  std::copy_n(row_begin_.begin(), kRows * kRows, cursor.begin());
  max_support_ = 0;
  samples_.banded = false;
  for (const Found& f : found) {
    const std::uint32_t to = cursor[static_cast<std::size_t>(f.row)]++;
    const ClusterSample& s = *f.sample;
    const float support = f.at[3], band = s.band * inv;
    const FourFloats squares{support * support, band * band, 1, 1};
    const FourFloats inverse = 1.0F / squares;
    samples_.put(to, {f.at[0], f.at[1], f.at[2], inverse[0], s.nx, s.ny, s.nz, s.weight, support, inverse[1]});
    for (std::size_t c = 0; c < attributes; ++c) {
      const ClusteredBucket& from = *runs[f.run].from;
      samples_.attributes[c][to] = from.attributes[c][static_cast<std::size_t>(&s - from.samples.data())];
    }
    max_support_ = std::max(max_support_, support);
    samples_.banded |= band < support;
  }
}

void RowSamples::scale_supports(float factor) {
  for (std::size_t k = 0; k < count_; ++k) {
    TileSample s = samples_.all[k];
    s.support *= factor;
    s.inv_support2 = 1.0F / (s.support * s.support);
    samples_.put(k, s);
  }
  max_support_ *= factor;
}

int RowSamples::ranges(float y_lo, float y_hi, float z_lo, float z_hi, SampleRange* out) const {
  const auto row = [](float v) {
    return static_cast<int>(std::clamp(std::floor(v) - static_cast<float>(kLow), 0.0F, static_cast<float>(kRows - 1)));
  };
  const int y0 = row(y_lo - max_support_);
  const int y1 = row(y_hi + max_support_);
  const int z1 = row(z_hi + max_support_);
  int n = 0;
  for (int z = row(z_lo - max_support_); z <= z1; ++z) {
    const std::uint32_t begin = row_begin_[static_cast<std::size_t>(z * kRows + y0)];
    const std::uint32_t end = row_begin_[static_cast<std::size_t>(z * kRows + y1 + 1)];
    if (begin == end) continue;
    if (n > 0 && out[n - 1].end == begin) {
      out[n - 1].end = end;
    } else {
      out[n++] = {begin, end};
    }
  }
  return n;
}

}  // namespace lamina

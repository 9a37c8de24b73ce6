#include "project/tile_samples.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <tuple>

namespace lamina {
namespace {

struct Entry {
  std::uint32_t tile, sample;
};

/// Samples per piece of work; fixed, so that the order does not depend on the number of threads.
constexpr std::size_t kPiece = 1u << 14;

/// Samples fetched ahead of their turn.
constexpr std::size_t kPrefetch = 24;

struct Piece {
  const ActiveBucket* bucket;
  std::size_t begin, end;
  std::uint32_t base;  ///< index of the bucket's first sample in the batch
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

void bin_piece(const Lattice& lattice, int level, const Piece& piece, std::int32_t first, std::int32_t end,
               std::span<const Block> tiles, const TileTable& table, float margin, double shift,
               std::vector<Entry>& out) {
  const double inv = 1.0 / lattice.cell_size(level);
  const LocalSamples& s = piece.bucket->samples;
  for (std::size_t i = piece.begin; i < piece.end; ++i) {
    if (piece.bucket->support[i] <= 0) continue;
    const double reach = (static_cast<double>(piece.bucket->support[i]) + static_cast<double>(margin)) * inv;
    const double z = s.z[i] * inv - shift;
    const std::int32_t z0 = std::max(ceil_cell(z - reach), first);
    const std::int32_t z1 = std::min(floor_cell(z + reach), end - 1);
    if (z0 > z1) continue;
    const double x = s.x[i] * inv - shift;
    const double y = s.y[i] * inv - shift;
    const std::int32_t x0 = ceil_cell(x - reach) >> 3;
    const std::int32_t x1 = floor_cell(x + reach) >> 3;
    const std::int32_t y0 = ceil_cell(y - reach) >> 3;
    const std::int32_t y1 = floor_cell(y + reach) >> 3;
    // A support far larger than a tile reaches more places than there are tiles.
    if ((double{1} + x1 - x0) * (double{1} + y1 - y0) > static_cast<double>(tiles.size())) {
      for (std::size_t t = 0; t < tiles.size(); ++t) {
        const Block& b = tiles[t];
        if (b.x < x0 || b.x > x1 || b.y < y0 || b.y > y1 || b.z < (z0 >> 3) || b.z > (z1 >> 3)) continue;
        out.push_back({static_cast<std::uint32_t>(t), piece.base + static_cast<std::uint32_t>(i)});
      }
      continue;
    }
    for (std::int32_t bz = z0 >> 3; bz <= (z1 >> 3); ++bz) {
      for (std::int32_t by = y0; by <= y1; ++by) {
        for (std::int32_t bx = x0; bx <= x1; ++bx) {
          const std::uint32_t tile = table.find({bx, by, bz});
          if (tile != TileTable::kNone) out.push_back({tile, piece.base + static_cast<std::uint32_t>(i)});
        }
      }
    }
  }
}

}  // namespace

TileBins bin_samples(const Lattice& lattice, int level, const Batch& batch, std::int32_t first, std::int32_t end,
                     std::span<const Block> tiles, float margin, double shift) {
  std::vector<Piece> pieces;
  std::uint32_t base = 0;
  for (const auto& bucket : batch) {
    const std::size_t n = bucket->samples.size();
    for (std::size_t b = 0; b < n; b += kPiece) pieces.push_back({bucket.get(), b, std::min(n, b + kPiece), base});
    base += static_cast<std::uint32_t>(n);
  }
  const TileTable table(tiles);
  std::vector<std::vector<Entry>> entries(pieces.size());
  tbb::parallel_for(std::size_t{0}, pieces.size(), [&](std::size_t p) {
    bin_piece(lattice, level, pieces[p], first, end, tiles, table, margin, shift, entries[p]);
  });
  TileBins bins;
  bins.begin.assign(tiles.size() + 1, 0);
  for (const auto& piece : entries) {
    for (const Entry& e : piece) ++bins.begin[e.tile + 1];
  }
  for (std::size_t t = 0; t < tiles.size(); ++t) bins.begin[t + 1] += bins.begin[t];
  bins.index.resize(bins.begin.back());
  std::vector<std::uint64_t> cursor(bins.begin.begin(), bins.begin.end() - 1);
  for (const auto& piece : entries) {
    for (const Entry& e : piece) bins.index[cursor[e.tile]++] = e.sample;
  }
  return bins;
}

void pack(const Batch& batch, const Lattice& lattice, PackedBatch& out) {
  std::vector<std::size_t> base(batch.size() + 1, 0);
  for (std::size_t b = 0; b < batch.size(); ++b) base[b + 1] = base[b] + batch[b]->samples.size();
  out.attribute_count = batch.empty() ? 0 : batch.front()->samples.attributes.size();
  out.samples.resize(base.back());
  out.attributes.resize(base.back() * out.attribute_count);
  tbb::parallel_for(std::size_t{0}, batch.size(), [&](std::size_t b) {
    const ActiveBucket& bucket = *batch[b];
    const LocalSamples& s = bucket.samples;
    for (std::size_t i = 0; i < s.size(); ++i) {
      const auto cell = static_cast<float>(lattice.cell_size(bucket.level[i]));
      out.samples[base[b] + i] = {s.x[i],          s.y[i], s.z[i], s.nx[i], s.ny[i], s.nz[i], cell, bucket.support[i],
                                  bucket.weight[i]};
      for (std::size_t c = 0; c < out.attribute_count; ++c)
        out.attributes[(base[b] + i) * out.attribute_count + c] = s.attributes[c][i];
    }
  });
}

void RowSamples::gather(const Lattice& lattice, int level, const Block& block, const PackedBatch& batch,
                        const std::uint32_t* index, std::size_t count, float band) {
  const std::int32_t a = lattice.cell_size(level);
  const float inv = 1.0F / static_cast<float>(a);
  // Differences are taken in integers: exact however far the tile lies from the origin.
  const std::int64_t ox = std::int64_t{block.x} * 8 * a;
  const std::int64_t oy = std::int64_t{block.y} * 8 * a;
  const std::int64_t oz = std::int64_t{block.z} * 8 * a;
  const std::size_t attributes = batch.attribute_count;
  samples_.resize(count, attributes);
  row_.resize(count);
  row_begin_.assign(kRows * kRows + 1, 0);
  max_support_ = 0;

  // Rows by the very coordinates the sums use: what ranges() cuts off lies beyond the support in these, too.
  const auto row_of = [inv](std::int64_t steps) {
    return static_cast<int>(std::clamp(std::floor(static_cast<float>(steps) * inv) - static_cast<float>(kLow), 0.0F,
                                       static_cast<float>(kRows - 1)));
  };
  for (std::size_t k = 0; k < count; ++k) {
    // Tiles of clouds in random order find their samples all over the batch, which no cache holds.
    __builtin_prefetch(&batch.samples[index[std::min(k + kPrefetch, count - 1)]]);
    const PackedSample& s = batch.samples[index[k]];
    const int row = row_of(s.z - oz) * kRows + row_of(s.y - oy);
    row_[k] = static_cast<std::uint16_t>(row);
    ++row_begin_[static_cast<std::size_t>(row) + 1];
  }
  for (std::size_t r = 0; r < kRows * kRows; ++r) row_begin_[r + 1] += row_begin_[r];
  std::array<std::uint32_t, kRows * kRows> cursor{};
  std::copy_n(row_begin_.begin(), kRows * kRows, cursor.begin());
  for (std::size_t k = 0; k < count; ++k) {
    const PackedSample& s = batch.samples[index[k]];
    const std::uint32_t to = cursor[row_[k]]++;
    samples_.x[to] = static_cast<float>(s.x - ox) * inv;
    samples_.y[to] = static_cast<float>(s.y - oy) * inv;
    samples_.z[to] = static_cast<float>(s.z - oz) * inv;
    samples_.nx[to] = s.nx;
    samples_.ny[to] = s.ny;
    samples_.nz[to] = s.nz;
    const float support = s.support * inv;
    const float reach = band * s.cell * inv;
    samples_.support[to] = support;
    samples_.inv_support2[to] = 1.0F / (support * support);
    samples_.inv_band2[to] = 1.0F / (reach * reach);
    samples_.weight[to] = s.weight;
    const float* const own = batch.attributes.data() + index[k] * attributes;
    for (std::size_t c = 0; c < attributes; ++c) samples_.attributes[c][to] = own[c];
    max_support_ = std::max(max_support_, support);
  }
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

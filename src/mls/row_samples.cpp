#include "mls/row_samples.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace lamina {

void RowSamples::gather(const Lattice& lattice, const QueryLayers& layers, const Block& block,
                        std::span<const Run> runs, float band) {
  select(lattice, layers, block, runs);
  place(lattice, layers.level, runs, band);
}

void RowSamples::select(const Lattice& lattice, const QueryLayers& layers, const Block& block,
                        std::span<const Run> runs) {
  constexpr std::size_t kStrip = 64;
  const std::int32_t a = lattice.cell_size(layers.level);
  const float inv = 1.0F / static_cast<float>(a);
  // Differences are taken in integers: exact however far the tile lies from the origin.
  const auto origin = [a](std::int32_t b) {
    return static_cast<std::uint32_t>(b) * 8U * static_cast<std::uint32_t>(a);
  };
  const std::uint32_t ox = origin(block.x);
  const std::uint32_t oy = origin(block.y);
  const std::uint32_t oz = origin(block.z);
  // Points of the block: their middle, and how far they lie from it at most, rounding included.
  const float margin = layers.margin * inv + 1e-4F;
  const auto z_first = static_cast<float>(std::max(layers.first - block.z * 8, 0)) + layers.shift;
  const auto z_last = static_cast<float>(std::min(layers.end - 1 - block.z * 8, 7)) + layers.shift;
  const float middle = 3.5F + layers.shift;
  const float half = 3.5F + margin;
  const float z_middle = 0.5F * (z_first + z_last);
  const float z_half = 0.5F * (z_last - z_first) + margin;

  std::size_t n = 0;
  struct Strip {
    std::array<float, kStrip> x, y, z, support;
    std::array<std::int32_t, kStrip> row, keep;
  } p;
  for (std::uint32_t r = 0; r < runs.size(); ++r) {
    const ClusteredBucket& from = *runs[r].from;
    for (std::size_t begin = runs[r].begin; begin < runs[r].end; begin += kStrip) {
      const std::size_t count = std::min<std::size_t>(kStrip, runs[r].end - begin);
      const std::int32_t* const px = from.x.data() + begin;
      const std::int32_t* const py = from.y.data() + begin;
      const std::int32_t* const pz = from.z.data() + begin;
      const float* const ps = from.support.data() + begin;
      for (std::size_t i = 0; i < count; ++i) {
        const float x = static_cast<float>(static_cast<std::int32_t>(static_cast<std::uint32_t>(px[i]) - ox)) * inv;
        const float y = static_cast<float>(static_cast<std::int32_t>(static_cast<std::uint32_t>(py[i]) - oy)) * inv;
        const float z = static_cast<float>(static_cast<std::int32_t>(static_cast<std::uint32_t>(pz[i]) - oz)) * inv;
        const float s = ps[i] * inv;
        p.x[i] = x;
        p.y[i] = y;
        p.z[i] = z;
        p.support[i] = s;
        p.keep[i] = static_cast<int>(std::abs(x - middle) <= half + s) &
                    static_cast<int>(std::abs(y - middle) <= half + s) &
                    static_cast<int>(std::abs(z - z_middle) <= z_half + s);
        // Rows by the very coordinates the sums use: what ranges() cuts off lies beyond the support in these, too.
        constexpr float kLast = kRows - 1;
        const float row_y = std::min(std::max(std::floor(y) - static_cast<float>(kLow), 0.0F), kLast);
        const float row_z = std::min(std::max(std::floor(z) - static_cast<float>(kLow), 0.0F), kLast);
        p.row[i] = static_cast<std::int32_t>(row_z) * kRows + static_cast<std::int32_t>(row_y);
      }
      if (n + count > found_.size()) found_.resize(2 * found_.size() + count);
      for (std::size_t i = 0; i < count; ++i) {
        found_[n] = {p.x[i], p.y[i], p.z[i], p.support[i], p.row[i], r, static_cast<std::uint32_t>(begin + i)};
        n += static_cast<std::size_t>(p.keep[i]);
      }
    }
  }
  count_ = n;
}

void RowSamples::place(const Lattice& lattice, int level, std::span<const Run> runs, float band) {
  const float inv = 1.0F / static_cast<float>(lattice.cell_size(level));
  const std::size_t attributes = runs.empty() ? 0 : runs.front().from->attributes.size();
  // Longer than that they may stay: what lies behind the ranges is not looked at.
  if (samples_.x.size() < count_ || samples_.attributes.size() != attributes) samples_.resize(count_, attributes);
  const std::span<const Found> found(found_.data(), count_);
  row_begin_.assign(kRows * kRows + 1, 0);
  for (const Found& f : found) ++row_begin_[static_cast<std::size_t>(f.row) + 1];
  for (std::size_t r = 0; r < kRows * kRows; ++r) row_begin_[r + 1] += row_begin_[r];
  std::array<std::uint32_t, kRows * kRows> cursor{};
  std::copy_n(row_begin_.begin(), kRows * kRows, cursor.begin());
  max_support_ = 0;
  for (const Found& f : found) {
    const std::uint32_t to = cursor[static_cast<std::size_t>(f.row)]++;
    const ClusteredBucket& from = *runs[f.run].from;
    samples_.x[to] = f.x;
    samples_.y[to] = f.y;
    samples_.z[to] = f.z;
    samples_.nx[to] = from.nx[f.sample];
    samples_.ny[to] = from.ny[f.sample];
    samples_.nz[to] = from.nz[f.sample];
    samples_.support[to] = f.support;
    samples_.weight[to] = from.weight[f.sample];
    samples_.inv_band2[to] = from.cell[f.sample];
    for (std::size_t c = 0; c < attributes; ++c) samples_.attributes[c][to] = from.attributes[c][f.sample];
    max_support_ = std::max(max_support_, f.support);
  }
  samples_.banded = false;
  for (std::size_t k = 0; k < count_; ++k) {
    const float limit = band * samples_.inv_band2[k] * inv;
    samples_.inv_support2[k] = 1.0F / (samples_.support[k] * samples_.support[k]);
    samples_.inv_band2[k] = 1.0F / (limit * limit);
    samples_.banded |= limit < samples_.support[k];
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

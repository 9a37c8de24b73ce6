#include "mls/row_samples.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstring>

namespace lamina {
namespace {

/// Of the four lanes those in a set, one after the other; behind them anything.
constexpr std::array<std::array<std::uint32_t, 4>, 16> list_four() {
  std::array<std::array<std::uint32_t, 4>, 16> out{};
  for (unsigned set = 0; set < out.size(); ++set) {
    std::size_t n = 0;
    for (std::uint32_t lane = 0; lane < 4; ++lane) {
      if (((set >> lane) & 1U) != 0) out[set][n++] = lane;
    }
  }
  return out;
}
constexpr std::array<std::array<std::uint32_t, 4>, 16> kListedFour = list_four();

std::uint32_t steps_to(std::int32_t block, std::int32_t cell) {
  return static_cast<std::uint32_t>(block) * (8U * static_cast<std::uint32_t>(cell));
}

/// How far samples lie from a block's origin. In integers: exact however far both lie from the frame's origin.
std::int32_t from_origin(std::int32_t at, std::uint32_t origin) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(at) - origin);
}

typedef std::uint32_t FourWords
    __attribute__((vector_size(16)));  // NOLINT(modernize-use-using): attributes on typedefs

/// An axis of the box of a block's points, and of four samples at once whether they can reach it.
class ReachedAxis {
 public:
  /// Cells: the points' middle, and how far they lie from it at most.
  ReachedAxis(std::uint32_t origin, float inv, float middle, float half)
      : origin_{origin, origin, origin, origin}, inv_(inv), middle_(middle), half_(half) {}

  [[nodiscard]] FourInts near(const std::int32_t* at, const FourFloats& support) const {
    const FourWords steps = std::bit_cast<FourWords>(load_four(at)) - origin_;
    const FourFloats off = to_floats(std::bit_cast<FourInts>(steps)) * inv_ - middle_;
    return (off > -off ? off : -off) <= half_ + support;
  }

 private:
  FourWords origin_;
  float inv_, middle_, half_;
};

/// Asks for the first values of a run, which lie anywhere in memory, before they are looked at; those that follow the
/// processor asks for itself. Always inlined: the compiler takes a function that does nothing else for one without
/// effect.
template <typename T>
[[gnu::always_inline]] inline void ask_for(const std::vector<T>& values, const Run& run) {
  constexpr std::size_t kLine = 64;  // bytes
  const char* const first = reinterpret_cast<const char*>(values.data() + run.begin);
  for (std::size_t line = 0; line < 3; ++line) __builtin_prefetch(first + line * kLine);
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

}  // namespace

void RowSamples::gather(const Lattice& lattice, const QueryLayers& layers, const Block& block,
                        std::span<const Run> runs) {
  select(lattice, layers, block, runs);
  find_rows(lattice, layers.level, block, runs);
  place(lattice, layers.level, runs);
}

void RowSamples::select(const Lattice& lattice, const QueryLayers& layers, const Block& block,
                        std::span<const Run> runs) {
  const std::int32_t a = lattice.cell_size(layers.level);
  const float inv = 1.0F / static_cast<float>(a);
  // Points of the block: their middle, and how far they lie from it at most, rounding included.
  const float margin = layers.margin * inv + 1e-4F;
  const auto z_first = static_cast<float>(std::max(layers.first - block.z * 8, 0)) + layers.shift;
  const auto z_last = static_cast<float>(std::min(layers.end - 1 - block.z * 8, 7)) + layers.shift;
  const float half = 3.5F + margin;
  const ReachedAxis x(steps_to(block.x, a), inv, 3.5F + layers.shift, half);
  const ReachedAxis y(steps_to(block.y, a), inv, 3.5F + layers.shift, half);
  const ReachedAxis z(steps_to(block.z, a), inv, 0.5F * (z_first + z_last), 0.5F * (z_last - z_first) + margin);

  kept_end_.resize(runs.size());
  std::size_t n = 0;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    if (r + 1 < runs.size()) {
      const Run& next = runs[r + 1];
      for (const auto* values : {&next.from->x, &next.from->y, &next.from->z}) ask_for(*values, next);
      ask_for(next.from->support, next);
    }
    const auto& [from, begin, end] = runs[r];
    const std::size_t most = n + (end - begin) + 3;
    if (most > kept_.size()) kept_.resize(2 * most);
    for (std::uint32_t i = begin; i < end; i += 4) {
      FourFloats support;
      std::memcpy(&support, &from->support[i], sizeof(support));
      support *= inv;
      const FourInts near = x.near(&from->x[i], support) & y.near(&from->y[i], support) & z.near(&from->z[i], support);
      const unsigned there = (1U << std::min(end - i, 4U)) - 1;
      const unsigned keep = bits_of(near) & there;
      // All four are written, what is not kept is written over.
      const FourInts numbers = load_four(kListedFour[keep].data()) + four_times(static_cast<std::int32_t>(i));
      std::memcpy(&kept_[n], &numbers, sizeof(numbers));
      n += static_cast<std::size_t>(std::popcount(keep));
    }
    kept_end_[r] = static_cast<std::uint32_t>(n);
  }
  count_ = n;
}

void RowSamples::find_rows(const Lattice& lattice, int level, const Block& block, std::span<const Run> runs) {
  const std::int32_t a = lattice.cell_size(level);
  const float inv = 1.0F / static_cast<float>(a);
  const std::uint32_t x = steps_to(block.x, a);
  const std::uint32_t y = steps_to(block.y, a);
  const std::uint32_t z = steps_to(block.z, a);
  if (found_.size() < count_) found_.resize(2 * count_);
  std::size_t k = 0;
  for (std::uint32_t r = 0; r < runs.size(); ++r) {
    const ClusteredBucket& from = *runs[r].from;
    for (; k < kept_end_[r]; ++k) {
      const std::uint32_t i = kept_[k];
      const ClusterSample& sample = from.samples[i];
      __builtin_prefetch(&sample);
      const FourInts steps{from_origin(from.x[i], x), from_origin(from.y[i], y), from_origin(from.z[i], z), 0};
      FourFloats at = to_floats(steps) * inv;
      at[3] = from.support[i] * inv;
      found_[k] = {at, &sample, row_of(at), r};
    }
  }
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

// How the kernel finds the samples that act on a group of query points; included by kernel_source.h, inside its
// namespace. No include guard on purpose.

/// The box of a group's query points, a little wider than it is: rounding must not lose a sample.
struct QueryBox {
  float x, y, z;     ///< middle
  float hx, hy, hz;  ///< half its sides
};

inline QueryBox box_of(const Queries& q) {
  constexpr float kWider = 1e-3F;
  const auto [x0, x1] = extremes_of(q.x);
  const auto [y0, y1] = extremes_of(q.y);
  const auto [z0, z1] = extremes_of(q.z);
  return {0.5F * (x0 + x1),          0.5F * (y0 + y1),          0.5F * (z0 + z1),
          0.5F * (x1 - x0) + kWider, 0.5F * (y1 - y0) + kWider, 0.5F * (z1 - z0) + kWider};
}

/// A bit for each of eight that a comparison holds for.
inline unsigned bits_of(const IntVec& holds) {
  __m128 low;
  __m128 high;
  __builtin_memcpy(&low, &holds, sizeof(low));
  __builtin_memcpy(&high, reinterpret_cast<const char*>(&holds) + sizeof(low), sizeof(high));
  return static_cast<unsigned>(_mm_movemask_ps(low)) | static_cast<unsigned>(_mm_movemask_ps(high)) << 4;
}

/// For each set of eight lanes their numbers, one after the other; behind them zeros.
constexpr std::array<std::uint64_t, 256> list_lanes() {
  std::array<std::uint64_t, 256> out{};
  for (unsigned set = 0; set < out.size(); ++set) {
    int n = 0;
    for (unsigned lane = 0; lane < kLanes; ++lane) {
      if (((set >> lane) & 1U) != 0) out[set] |= std::uint64_t{lane} << (8 * n++);
    }
  }
  return out;
}
inline constexpr std::array<std::uint64_t, 256> kListedLanes = list_lanes();

/// Goes over the samples of ranges, eight at a time, and picks those that act on a box.
class Picker {
 public:
  static constexpr int kMost = 128;

  Picker(const TileSamples& s, const SampleRange* ranges, int count, const Queries& query)
      : x_(s.x.data()),
        y_(s.y.data()),
        z_(s.z.data()),
        inv_support2_(s.inv_support2.data()),
        range_(ranges),
        end_(ranges + count),
        box_(box_of(query)) {
    if (count > 0) at_ = range_->begin;
  }
  /// The next ones in their order; none when all have been looked at.
  int next(std::uint32_t* out) {
    int n = 0;
    while (range_ != end_ && n <= kMost - kLanes) {
      if (at_ >= range_->end) {
        if (++range_ != end_) at_ = range_->begin;
        continue;
      }
      const std::uint32_t left = range_->end - at_;
      const unsigned keep = acting(at_) & ((1U << (left < kLanes ? left : kLanes)) - 1);
      // All eight are written, what is not kept is written over: which are is as good as random.
      const std::uint64_t lanes = kListedLanes[keep];
      put_numbers(static_cast<std::uint32_t>(lanes), out + n);
      put_numbers(static_cast<std::uint32_t>(lanes >> 32), out + n + 4);
      n += std::popcount(keep);
      at_ += kLanes;
    }
    return n;
  }

 private:
  /// Of four samples whose lanes are the bytes of a word. The compiler would make numbers of bytes one by one.
  void put_numbers(std::uint32_t lanes, std::uint32_t* out) const {
    const __m128i four = _mm_cvtepu8_epi32(_mm_cvtsi32_si128(static_cast<int>(lanes)));
    _mm_storeu_si128(reinterpret_cast<__m128i*>(out), _mm_add_epi32(four, _mm_set1_epi32(static_cast<int>(at_))));
  }
  /// Of eight samples, a bit each; those behind the last one are anything.
  unsigned acting(std::uint32_t i) const {
    const Vec dx = outside(load(x_ + i), box_.x, box_.hx);
    const Vec dy = outside(load(y_ + i), box_.y, box_.hy);
    const Vec dz = outside(load(z_ + i), box_.z, box_.hz);
    return bits_of((dx * dx + dy * dy + dz * dz) * load(inv_support2_ + i) < splat(1.0F));
  }
  static Vec outside(const Vec& v, float middle, float half) {
    const Vec d = v - splat(middle);
    const Vec far = (d > -d ? d : -d) - splat(half);
    return far > splat(0.0F) ? far : splat(0.0F);
  }

  const float* x_;
  const float* y_;
  const float* z_;
  const float* inv_support2_;
  const SampleRange* range_;
  const SampleRange* end_;
  std::uint32_t at_ = 0;
  QueryBox box_;
};

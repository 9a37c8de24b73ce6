// The band grows: a known voxel gives those that lie beyond it along its normal the distance of its tangent plane.
#include <tbb/parallel_for.h>
#include <xmmintrin.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <span>

#include "volume/band.h"
#include "window/bits.h"

namespace lamina::volume {
namespace {

struct Offset {
  int x, y, z;
  float squared;  ///< length
};

/// Rows along y, then x, then z. The middle is one of them, and out of everybody's reach.
constexpr std::array<Offset, 27> make_offsets() {
  std::array<Offset, 27> out{};
  for (int i = 0; i < 27; ++i) {
    const int x = i / 3 % 3 - 1, y = i % 3 - 1, z = i / 9 - 1;
    out[static_cast<std::size_t>(i)] = {x, y, z, static_cast<float>(x * x + y * y + z * z)};
  }
  return out;
}
constexpr std::array<Offset, 27> kOffsets = make_offsets();
constexpr std::array<int, 27> make_steps() {
  std::array<int, 27> out{};
  for (std::size_t i = 0; i < 27; ++i) out[i] = kOffsets[i].x + 8 * kOffsets[i].y + 64 * kOffsets[i].z;
  return out;
}
constexpr std::array<int, 27> kSteps = make_steps();  ///< in a brick

/// A voxel reaches another as far as the way to it leads along its normal: squared sideways distance below this. The
/// best of 26 directions is off by 0.35 at most; a whole voxel sideways would let the band grow over a rim.
constexpr float kSideways = 0.75F;
/// Repaired corners count within this distance of the surface, voxels.
constexpr float kRepaired = 1;

/// The offsets behind the middle, four at a time; those before it are their opposites. What fills the last four is out
/// of reach.
constexpr int kFours = 4, kBehind = 14;
struct FourOffsets {
  Plane x, y, z, room;  ///< `room`: what is left of kSideways
};
constexpr std::array<FourOffsets, kFours> make_fours() {
  std::array<FourOffsets, kFours> out{};
  for (std::size_t i = 0; i < kFours; ++i) {
    std::array<Offset, 4> o{};
    for (std::size_t k = 0; k < 4; ++k)
      o[k] = 4 * i + k + kBehind < 27 ? kOffsets[4 * i + k + kBehind] : Offset{0, 0, 0, 1};
    const auto four = [&o](auto value) { return Plane{value(o[0]), value(o[1]), value(o[2]), value(o[3])}; };
    out[i] = {four([](const Offset& to) { return static_cast<float>(to.x); }),
              four([](const Offset& to) { return static_cast<float>(to.y); }),
              four([](const Offset& to) { return static_cast<float>(to.z); }),
              four([](const Offset& to) { return kSideways - to.squared; })};
  }
  return out;
}
constexpr std::array<FourOffsets, kFours> kFourOffsets = make_fours();

/// What a voxel says to those around it.
struct Reach {
  /// The offsets behind the middle of which either they or their opposites are reached, and which of the two.
  std::uint32_t pairs = 0, behind = 0;
  std::array<Plane, kFours> up, weight;

  /// Away from the surface only: what lies towards it is a hole in the data, not a part of the band.
  explicit Reach(const Plane& plane) {
    const float away = plane[3] < 0 ? -1 : 1;
    const auto bits_of = [](const auto& four, std::size_t i) {
      return static_cast<std::uint32_t>(_mm_movemask_ps(std::bit_cast<__m128>(four))) << (4 * i);
    };
    for (std::size_t i = 0; i < kFours; ++i) {
      const FourOffsets& to = kFourOffsets[i];
      up[i] = plane[0] * to.x + plane[1] * to.y + plane[2] * to.z;
      const Plane near = to.room + up[i] * up[i];
      weight[i] = near * near * near * near;
      pairs |= bits_of(near > 0, i);
      behind |= bits_of(up[i] * away > 0, i);
    }
  }
};

/// A voxel's eight bits of a row, three places apart.
constexpr std::array<std::uint32_t, 256> make_spread() {
  std::array<std::uint32_t, 256> out{};
  for (std::uint32_t row = 0; row < 256; ++row)
    for (std::uint32_t x = 0; x < 8; ++x) out[row] |= (row >> x & 1) << (3 * x);
  return out;
}
constexpr std::array<std::uint32_t, 256> kSpread = make_spread();

/// The voxels of a brick that want a value, laid out for those around a source to lie side by side.
class Targets {
 public:
  Targets(const BlockMask& wanted, int begin, int end) {
    for (int z = begin; z < end; ++z) {
      for (int y = 0; y < 8; ++y) {
        const std::uint64_t row = std::uint64_t{kSpread[wanted.words[z] >> (8 * y) & 0xFF]} << 6;
        if (row == 0) continue;
        rows_[at(z, y - 1)] |= row << 2;
        rows_[at(z, y)] |= row << 1;
        rows_[at(z, y + 1)] |= row;
      }
    }
  }
  /// As bits of kOffsets; the voxel may lie one beside the brick.
  [[nodiscard]] std::uint32_t beside(int x, int y, int z) const {
    const int shift = 3 * (x + 1);
    const auto nine = [&](int layer) { return static_cast<std::uint32_t>(rows_[at(layer, y)] >> shift) & 0x1FF; };
    return nine(z - 1) | nine(z) << 9 | nine(z + 1) << 18;
  }

 private:
  static constexpr int kRows = 10, kLayers = 12;  ///< y from -1, z from -2
  static std::size_t at(int z, int y) { return static_cast<std::size_t>((z + 2) * kRows + y + 1); }
  /// Three bits, those of the rows y - 1, y, y + 1, for each x from -2 on.
  std::array<std::uint64_t, std::size_t{kRows} * kLayers> rows_{};
};

/// Weighted sums at the voxels of a brick.
struct Sums {
  std::array<float, 512> weight;
  std::array<Plane, 512> total;  ///< normal and distance
  std::vector<float> extra;

  void clear(int at, std::size_t channels) {
    weight[at] = 0;
    total[at] = Plane{};
    extra.resize(std::max(extra.size(), 512 * channels));
    for (std::size_t c = 0; c < channels; ++c) extra[c * 512 + at] = 0;
  }
  void add(int at, float w, const Plane& plane, const Brick& from, int from_at, std::size_t channels) {
    weight[at] += w;
    total[at] += w * plane;
    for (std::size_t c = 0; c < channels; ++c) extra[c * 512 + at] += w * from.extra[c * 512 + from_at];
  }
  /// False where neighbours of two sheets that face each other say nothing together.
  bool store(int at, float least, std::size_t channels, Brick& to) const {
    const Plane t = total[at], squares = t * t;
    const float squared = squares[0] + squares[1] + squares[2];
    if (!(squared > least * least * weight[at] * weight[at])) return false;
    const float inverse = 1 / weight[at], unit = 1 / std::sqrt(squared);
    to.plane[at] = t * Plane{unit, unit, unit, inverse};
    for (std::size_t c = 0; c < channels; ++c) to.extra[c * 512 + at] = extra[c * 512 + at] * inverse;
    return true;
  }
};

/// One step of one brick: from the voxels that the step before made known, in a fixed order, to those beside them that
/// are not. What older voxels reach is known already, but for places between two sheets that face each other.
class Step {
 public:
  Step(Brick& brick, int round, int begin, int end, const BandSettings& settings, float farthest, Sums& sums)
      : brick_(brick),
        round_(round),
        begin_(begin),
        end_(end),
        channels_(settings.channels.size()),
        farthest_(farthest),
        sums_(sums) {}

  void run() {
    for (int z = begin_; z < end_; ++z) brick_.known[round_].words[z] = brick_.known[round_ - 1].words[z];
    BlockMask wanted, contested;
    bits::Neighbourhood fresh{};
    for (int i = 0; i < 27; ++i)
      if (brick_.around[i] != nullptr) fresh[i / 9][i / 3 % 3][i % 3] = &brick_.around[i]->source[round_ - 1];
    bits::dilate_layers<-1, 1>(fresh, begin_, end_, wanted.words.data() + begin_);
    for (int z = begin_; z < end_; ++z) {
      wanted.words[z] &= ~brick_.known[round_ - 1].words[z];
      contested.words[z] = wanted.words[z] & brick_.contested.words[z];
    }
    if (wanted.any()) {
      for_each(wanted, [&](int at) { sums_.clear(at, channels_); });
      push(round_ - 1, wanted);
      for (int r = 0; contested.any() && r < round_ - 1; ++r) push(r, contested);
      for_each(wanted, [&](int at) {
        if (!(sums_.weight[at] > 0)) return;
        if (sums_.store(at, 0.5F, channels_, brick_)) {
          know(at);
        } else {
          brick_.contested.set(at);
        }
      });
    }
    if (round_ == 1) repair_gaps();
  }

 private:
  template <class Visit>
  void for_each(const BlockMask& mask, const Visit& visit) const {
    for (int z = begin_; z < end_; ++z)
      for (std::uint64_t w = mask.words[z]; w != 0; w &= w - 1) visit(z * 64 + std::countr_zero(w));
  }

  /// A source with something to say.
  struct Pusher {
    const Brick* from;
    std::uint32_t beside;   ///< the offsets of wanted voxels
    std::int16_t at, here;  ///< its place in its own brick, and as seen from this one
  };

  void push(int round, const BlockMask& wanted) {
    const Targets targets(wanted, begin_, end_);
    // Their values are on the way from memory while the next are looked for.
    std::array<Pusher, 32> waiting;
    std::size_t count = 0;
    for (int i = 0; i < 27; ++i) {
      const Brick* const from = brick_.around[i];
      if (from == nullptr) continue;
      // Of the bricks around only what touches this one.
      const int dx = i % 3 - 1, dy = i / 3 % 3 - 1, dz = i / 9 - 1;
      std::uint64_t near = ~std::uint64_t{0};
      if (dx != 0) near &= dx < 0 ? ~bits::columns_below(7) : bits::columns_below(1);
      if (dy != 0) near &= std::uint64_t{0xFF} << (dy < 0 ? 56 : 0);
      for (int z = std::max(begin_ - 1, dz * 8); z < std::min(end_ + 1, dz * 8 + 8); ++z) {
        for (std::uint64_t w = from->source[round].words[z & 7] & near; w != 0; w &= w - 1) {
          const int bit = std::countr_zero(w), x = (bit & 7) + 8 * dx, y = (bit >> 3) + 8 * dy;
          const std::uint32_t beside = targets.beside(x, y, z);
          if (beside == 0) continue;
          const int at = (z & 7) * 64 + bit;
          __builtin_prefetch(&from->plane[at]);
          waiting[count++] = {from, beside, static_cast<std::int16_t>(at),
                              static_cast<std::int16_t>(x + 8 * y + 64 * z)};
          if (count < waiting.size()) continue;
          push_all({waiting.data(), count});
          count = 0;
        }
      }
    }
    push_all({waiting.data(), count});
  }

  void push_all(std::span<const Pusher> pushers) {
    for (const Pusher& p : pushers) {
      const Plane plane = p.from->plane[p.at];
      const Reach reach(plane);
      for (std::uint32_t list = reach.pairs; list != 0; list &= list - 1) {
        const auto i = static_cast<std::size_t>(std::countr_zero(list));
        const bool behind = (reach.behind >> i & 1) != 0;
        const std::size_t o = behind ? kBehind + i : 26 - kBehind - i;
        if ((p.beside >> o & 1) == 0) continue;
        const float up = behind ? reach.up[i / 4][i % 4] : -reach.up[i / 4][i % 4];
        sums_.add(p.here + kSteps[o], reach.weight[i / 4][i % 4], plane + Plane{0, 0, 0, up}, *p.from, p.at, channels_);
      }
    }
  }

  void know(int at) {
    brick_.known[round_].set(at);
    if (std::abs(brick_.distance(static_cast<std::size_t>(at))) < farthest_) brick_.source[round_].set(at);
  }

  void repair_gaps() {
    for (int z = begin_; z < end_; ++z) {
      for (std::uint64_t w = brick_.repaired.words[z] & ~brick_.known[1].words[z]; w != 0; w &= w - 1) {
        const int at = z * 64 + std::countr_zero(w);
        if (repair(at)) know(at);
      }
    }
  }

  /// A gap between samples that extraction bridges. As corner_value() does it: the mean of all neighbours' planes,
  /// weights 1 / m^2.
  bool repair(int at) {
    sums_.clear(at, channels_);
    for (const Offset& o : kOffsets) {
      if (o.squared == 0) continue;
      const int x = (at & 7) + o.x, y = (at >> 3 & 7) + o.y, z = (at >> 6) + o.z;
      const Brick* const from = brick_.around[((x + 8) >> 3) + 3 * ((y + 8) >> 3) + 9 * ((z + 8) >> 3)];
      const int from_at = BlockMask::offset(x & 7, y & 7, z & 7);
      if (from == nullptr || !from->known[0].test(from_at)) continue;
      const Plane plane = from->plane[from_at];
      const float along = -(plane[0] * static_cast<float>(o.x) + plane[1] * static_cast<float>(o.y) +
                            plane[2] * static_cast<float>(o.z));
      sums_.add(at, 1 / (o.squared * o.squared), plane + Plane{0, 0, 0, along}, *from, from_at, channels_);
    }
    return sums_.weight[at] > 0 && std::abs(sums_.total[at][3]) <= kRepaired * sums_.weight[at] &&
           sums_.store(at, 1e-6F, channels_, brick_);
  }

  Brick& brick_;
  int round_, begin_, end_;
  std::size_t channels_;
  float farthest_;
  Sums& sums_;
};

}  // namespace

void Band::grow(int round, std::int32_t begin, std::int32_t end) {
  struct Job {
    Brick* brick;
    int begin, end;
  };
  std::vector<Job> jobs;
  for (std::int32_t bz = begin >> 3; bz <= (end - 1) >> 3; ++bz) {
    bricks_.for_each(bz, [&](Brick& brick) {
      jobs.push_back({&brick, std::max(0, begin - bz * 8), std::min(8, end - bz * 8)});
    });
  }
  tbb::parallel_for(std::size_t{0}, jobs.size(), [&](std::size_t j) {
    static thread_local Sums sums;
    Step(*jobs[j].brick, round, jobs[j].begin, jobs[j].end, settings_, farthest_, sums).run();
  });
}

}  // namespace lamina::volume

// The band grows: a known voxel gives those that lie beyond it along its normal the distance of its tangent plane.
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <span>

#include "volume/band.h"
#include "volume/band_reach.h"
#include "window/bits.h"

namespace lamina::volume {
namespace {

/// Repaired corners count within this distance of the surface, voxels.
constexpr float kRepaired = 1;

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
    PairBits beside;        ///< wanted voxels
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
          const PairBits beside = targets.beside(x, y, z);
          if (!beside.any()) continue;
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
      const std::uint32_t behind = reach.pairs & reach.behind & p.beside.behind;
      const std::uint32_t before = reach.pairs & ~reach.behind & p.beside.before;
      for (std::uint32_t list = behind | before; list != 0; list &= list - 1) {
        const auto i = static_cast<std::size_t>(std::countr_zero(list));
        const int way = (behind >> i & 1) != 0 ? 1 : -1;
        sums_.add(p.here + way * kPairSteps[i], reach.weight(i),
                  plane + Plane{0, 0, 0, static_cast<float>(way) * reach.up[i]}, *p.from, p.at, channels_);
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

// The band grows: a known voxel gives those that lie beyond it along its normal the distance of its tangent plane.
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>

#include "volume/band.h"
#include "volume/band_push.h"
#include "volume/band_reach.h"
#include "volume/brick_sides.h"
#include "window/bits.h"

namespace lamina::volume {
namespace {

/// Repaired corners count within this distance of the surface, voxels.
constexpr float kRepaired = 1;

/// What the sums at a voxel say; its distance, or nothing where neighbours of two sheets that face each other say
/// nothing together.
std::optional<float> store(const Sums& sums, int at, float least, std::size_t channels, Brick& to) {
  const float weight = sums.weight[at];
  const Plane t = sums.total[at], squares = t * t;
  const float squared = squares[0] + squares[1] + squares[2];
  if (!(squared > least * least * weight * weight)) return std::nullopt;
  const float length = std::sqrt(squared), both = 1 / (weight * length);
  const float inverse = both * length, unit = both * weight;
  const Plane plane = t * Plane{unit, unit, unit, inverse};
  to.plane[at] = plane;
  for (std::size_t c = 0; c < channels; ++c) to.extra[c * 512 + at] = sums.extra[c * 512 + at] * inverse;
  return plane[3];  // reading it again would wait for its way to memory
}

/// One step of one brick: from the voxels that the step before made known, in a fixed order, to those beside them that
/// are not. What older voxels reach is known already, but for places between two sheets that face each other.
class Step {
 public:
  Step(Brick& brick, int round, int begin, int end, const BandSettings& settings, Push way, Sums& sums)
      : brick_(brick),
        round_(round),
        begin_(begin),
        end_(end),
        channels_(settings.channels.size()),
        growth_(growth_of(settings)),
        push_(way),
        sums_(sums) {
    sums_.extra.resize(std::max(sums_.extra.size(), 512 * channels_));
  }

  void run() {
    for (int z = begin_; z < end_; ++z) brick_.known[round_].words[z] = brick_.known[round_ - 1].words[z];
    if (round_ < growth_.rounds) {
      learn(beside_sources());
    } else {
      const BlockMask beyond = learn_last();
      if (sides_depend_on(beyond)) learn(beyond);
    }
    if (round_ == 1) repair_gaps();
  }

 private:
  void learn(const BlockMask& wanted) {
    if (!wanted.any()) return;
    BlockMask contested;
    for (int z = begin_; z < end_; ++z) contested.words[z] = wanted.words[z] & brick_.contested.words[z];
    for_each(wanted, [&](int at) {
      sums_.clear(at, channels_);
      __builtin_prefetch(&brick_.plane[at], 1);
    });
    push(round_ - 1, wanted);
    for (int r = 0; contested.any() && r < round_ - 1; ++r) push(r, contested);
    for_each(wanted, [&](int at) {
      if (!(sums_.weight[at] > 0)) return;
      if (const auto distance = store(sums_, at, 0.5F, channels_, brick_))
        know(at, *distance);
      else
        brick_.contested.set(at);
    });
  }

  template <class Visit>
  void for_each(const BlockMask& mask, const Visit& visit) const {
    for (int z = begin_; z < end_; ++z)
      for (std::uint64_t w = mask.words[z]; w != 0; w &= w - 1) visit(z * 64 + std::countr_zero(w));
  }

  [[nodiscard]] const Brick* around(int dx, int dy, int dz) const {
    return brick_.around[static_cast<std::size_t>(13 + dx + 3 * dy + 9 * dz)];
  }

  [[nodiscard]] BlockMask beside(const bits::Neighbourhood& masks) const {
    BlockMask out;
    bits::dilate_layers<-1, 1>(masks, begin_, end_, out.words.data() + begin_);
    return out;
  }

  /// Unknown voxels beside those that the round before made known.
  [[nodiscard]] BlockMask beside_sources() const {
    bits::Neighbourhood masks{};
    for (int i = 0; i < 27; ++i)
      if (brick_.around[i] != nullptr) masks[i / 9][i / 3 % 3][i % 3] = &brick_.around[i]->source[round_ - 1];
    BlockMask out = beside(masks);
    for (int z = begin_; z < end_; ++z) out.words[z] &= ~brick_.known[round_].words[z];
    return out;
  }

  /// Unknown voxels that share a face with those that the round before made known.
  [[nodiscard]] BlockMask facing_sources() const {
    const auto sources = [this](int dx, int dy, int dz) -> const BlockMask& {
      const Brick* const from = around(dx, dy, dz);
      return from == nullptr ? bits::kNoBits : from->source[round_ - 1];
    };
    const BlockMask &here = sources(0, 0, 0), &left = sources(-1, 0, 0), &right = sources(1, 0, 0),
                    &front = sources(0, -1, 0), &back = sources(0, 1, 0);
    BlockMask out;
    for (int z = begin_; z < end_; ++z) {
      const std::uint64_t w = here.words[z];
      out.words[z] = bits::spread_x<-1, 1>(left.words[z], w, right.words[z]) |
                     bits::spread_y<-1, 1>(front.words[z], w, back.words[z]) |
                     (z > 0 ? here.words[z - 1] : sources(0, 0, -1).words[7]) |
                     (z < 7 ? here.words[z + 1] : sources(0, 0, 1).words[0]);
    }
    return out;
  }

  /// Nothing grows from the last round, and most of what it would reach lies beyond the band. Learns of what may lie in
  /// it; of the rest, which is returned, the side is taken from the voxels beside.
  BlockMask learn_last() {
    enum Kind : std::size_t { outside, inside, oblique };
    std::array<std::array<BlockMask, 27>, 3> masks;
    std::array<bits::Neighbourhood, 3> from{};
    std::array<bool, 3> any{};
    for (std::size_t i = 0; i < 27; ++i) {
      const Brick* const other = brick_.around[i];
      if (other == nullptr || !other->source[round_ - 1].any()) continue;
      for (std::size_t z = 0; z < 8; ++z) {
        const std::uint64_t w = other->source[round_ - 1].words[z];
        masks[outside][i].words[z] = w & ~other->negative.words[z];
        masks[inside][i].words[z] = w & other->negative.words[z];
        masks[oblique][i].words[z] = w & other->oblique.words[z];
      }
      for (const Kind k : {outside, inside, oblique}) {
        if (!masks[k][i].any()) continue;
        from[k][i / 9][i / 3 % 3][i % 3] = &masks[k][i];
        any[k] = true;
      }
    }
    std::array<BlockMask, 3> reached;
    for (const Kind k : {outside, inside, oblique})
      if (any[k]) reached[k] = beside(from[k]);
    BlockMask wanted = facing_sources(), beyond;
    for (int z = begin_; z < end_; ++z) {
      const std::uint64_t all = reached[outside].words[z] | reached[inside].words[z];
      const std::uint64_t doubtful =
          (reached[outside].words[z] & reached[inside].words[z]) | (all & brick_.contested.words[z]);
      std::uint64_t& known = brick_.known[round_].words[z];
      wanted.words[z] = (wanted.words[z] | reached[oblique].words[z] | doubtful) & ~known;
      beyond.words[z] = all & ~wanted.words[z] & ~known;
    }
    learn(wanted);
    for (int z = begin_; z < end_; ++z) {
      brick_.last_negative.words[z] |= beyond.words[z] & reached[inside].words[z];
      brick_.known[round_].words[z] |= beyond.words[z];
    }
    return beyond;
  }

  /// Whether voxels that nobody knows change sides with those `beyond`, some of which nobody may know either: then they
  /// are forgotten again.
  bool sides_depend_on(const BlockMask& beyond) {
    if (!beyond.any() || !brick_.active.any()) return false;
    const BlockMask negative = negative_of(brick_);
    BlockMask less_negative = negative, less_known = brick_.known[round_];
    for (int z = begin_; z < end_; ++z) {
      less_negative.words[z] &= ~beyond.words[z];
      less_known.words[z] &= ~beyond.words[z];
    }
    if (inside_of(negative, brick_.known[round_]).words == inside_of(less_negative, less_known).words) return false;
    brick_.known[round_] = less_known;
    for (int z = begin_; z < end_; ++z) brick_.last_negative.words[z] &= ~beyond.words[z];
    return true;
  }

  void push(int round, const BlockMask& wanted) {
    const Targets targets(wanted, begin_, end_);
    // Where one of them may be beside, a layer beyond the brick included. Of the bricks around only what touches this
    // one counts.
    bits::Neighbourhood only{};
    only[1][1][1] = &wanted;
    std::array<std::uint64_t, 10> reached;
    bits::dilate_layers<-1, 1>(only, -1, 9, reached.data());
    const auto touching = [&reached](int dx, int dy, int z) {
      std::uint64_t w = reached[static_cast<std::size_t>(z + 1)];
      if (dx != 0) w = dx < 0 ? (w & bits::columns_below(1)) << 7 : w >> 7 & bits::columns_below(1);
      return dy == 0 ? w : dy < 0 ? w << 56 : w >> 56;
    };
    // Their values are on the way from memory while the next are looked for.
    std::array<Pusher, 32> waiting;
    std::size_t count = 0;
    for (int i = 0; i < 27; ++i) {
      const Brick* const from = brick_.around[i];
      if (from == nullptr) continue;
      const int dx = i % 3 - 1, dy = i / 3 % 3 - 1, dz = i / 9 - 1;
      for (int z = std::max(begin_ - 1, dz * 8); z < std::min(end_ + 1, dz * 8 + 8); ++z) {
        for (std::uint64_t w = from->source[round].words[z & 7] & touching(dx, dy, z); w != 0; w &= w - 1) {
          const int bit = std::countr_zero(w), x = (bit & 7) + 8 * dx, y = (bit >> 3) + 8 * dy;
          const PairBits beside = targets.beside(x, y, z);
          if (!beside.any()) continue;
          const int at = (z & 7) * 64 + bit;
          __builtin_prefetch(&from->plane[at]);
          waiting[count++] = {from, beside, static_cast<std::int16_t>(at),
                              static_cast<std::int16_t>(x + 8 * y + 64 * z)};
          if (count < waiting.size()) continue;
          push_({waiting.data(), count}, channels_, sums_);
          count = 0;
        }
      }
    }
    push_({waiting.data(), count}, channels_, sums_);
  }

  void know(int at, float distance) {
    brick_.know(round_, at, distance, growth_);
  }

  void repair_gaps() {
    for (int z = begin_; z < end_; ++z) {
      for (std::uint64_t w = brick_.repaired.words[z] & ~brick_.known[1].words[z]; w != 0; w &= w - 1) {
        const int at = z * 64 + std::countr_zero(w);
        if (const auto distance = repair(at)) know(at, *distance);
      }
    }
  }

  /// A gap between samples that extraction bridges. As corner_value() does it: the mean of all neighbours' planes,
  /// weights 1 / m^2.
  std::optional<float> repair(int at) {
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
    const bool near = sums_.weight[at] > 0 && std::abs(sums_.total[at][3]) <= kRepaired * sums_.weight[at];
    return near ? store(sums_, at, 1e-6F, channels_, brick_) : std::nullopt;
  }

  Brick& brick_;
  int round_, begin_, end_;
  std::size_t channels_;
  Growth growth_;
  Push push_;
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
  static const Push way = available_pushes().back();
  tbb::parallel_for(std::size_t{0}, jobs.size(), [&](std::size_t j) {
    static thread_local Sums sums;
    Step(*jobs[j].brick, round, jobs[j].begin, jobs[j].end, settings_, way, sums).run();
  });
}

}  // namespace lamina::volume

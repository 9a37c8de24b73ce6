#include "levelset/band.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>

#include "lattice/morphology.h"

namespace lamina::volume {
namespace {

/// Repaired corners count within this distance of the surface, voxels.
constexpr float kRepaired = 1;

void add_pairs(const Source& source, const Plane& plane, std::size_t channels, Sums& sums) {
  const Stencil stencil(plane);
  const std::uint32_t behind = stencil.pairs & stencil.behind & source.wanted.behind;
  const std::uint32_t before = stencil.pairs & ~stencil.behind & source.wanted.before;
  for (std::uint32_t list = behind | before; list != 0; list &= list - 1) {
    const auto i = static_cast<std::size_t>(std::countr_zero(list));
    const int way = (behind >> i & 1) != 0 ? 1 : -1;
    sums.add(source.here + way * kPairSteps[i], weight_of(stencil.near[i]),
             plane + Plane{0, 0, 0, static_cast<float>(way) * stencil.up[i]}, *source.from, source.at, channels);
  }
}

/// What the sums at a voxel say, or nothing where neighbours of two sheets that face each other say
/// nothing together.
std::optional<Plane> store(const Sums& sums, int at, float least, std::size_t channels, Brick& to) {
  const float weight = sums.weight[at];
  const Plane t = sums.total[at], squares = t * t;
  const float squared = squares[0] + squares[1] + squares[2];
  if (!(squared > least * least * weight * weight)) return std::nullopt;
  const float length = std::sqrt(squared), both = 1 / (weight * length);
  const float inverse = both * length, unit = both * weight;
  const Plane plane = t * Plane{unit, unit, unit, inverse};
  to.plane[at] = plane;
  for (std::size_t c = 0; c < channels; ++c) to.extra[c * 512 + at] = sums.extra[c * 512 + at] * inverse;
  return plane;  // reading it again would wait for its way to memory
}

/// One step of one brick: from the voxels that the step before made known, in a fixed order, to those beside them that
/// are not. What older voxels reach is known already, but for places between two sheets that face each other.
class Step {
 public:
  Step(Brick& brick, int round, int begin, int end, const BandSettings& settings, Sums& sums)
      : brick_(brick),
        round_(round),
        begin_(begin),
        end_(end),
        channels_(settings.channels.size()),
        growth_(growth_of(settings)),
        sums_(sums) {
    sums_.extra.resize(std::max(sums_.extra.size(), 512 * channels_));
  }

  void run() {
    for (int z = begin_; z < end_; ++z) brick_.known[round_].words[z] = brick_.known[round_ - 1].words[z];
    if (round_ < growth_.rounds)
      learn_all();
    else
      learn_last();
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
    gather(round_ - 1, wanted);
    for (int r = 0; contested.any() && r < round_ - 1; ++r) gather(r, contested);
    for (int z = begin_; z < end_; ++z) {
      LayerMasks masks(round_, growth_);
      for (std::uint64_t w = wanted.words[z]; w != 0; w &= w - 1) {
        const int bit = std::countr_zero(w), at = z * 64 + bit;
        if (!(sums_.weight[at] > 0)) continue;
        if (const auto plane = store(sums_, at, 0.5F, channels_, brick_))
          masks.add(bit, *plane);
        else
          brick_.contested.set(at);
      }
      brick_.know(z, masks);
    }
  }

  template <class Visit>
  void for_each(const BlockMask& mask, const Visit& visit) const {
    for (int z = begin_; z < end_; ++z)
      for (std::uint64_t w = mask.words[z]; w != 0; w &= w - 1) visit(z * 64 + std::countr_zero(w));
  }

  /// A mask of the bricks around.
  template <class Of>
  [[nodiscard]] bits::Neighbourhood around(const Of& of) const {
    bits::Neighbourhood out{};
    for (std::size_t i = 0; i < 27; ++i)
      if (const Brick* const brick = brick_.around[i]) out[i / 9][i / 3 % 3][i % 3] = &of(*brick);
    return out;
  }
  [[nodiscard]] BlockMask beside_sources(std::size_t side) const {
    return bits::dilate(around([&](const Brick& b) -> const BlockMask& { return b.source[before()][side]; }));
  }
  [[nodiscard]] std::size_t before() const { return static_cast<std::size_t>(round_ - 1); }

  void learn_all() {
    const BlockMask outside = beside_sources(0), inside = beside_sources(1);
    BlockMask wanted;
    for (int z = begin_; z < end_; ++z)
      wanted.words[z] = (outside.words[z] | inside.words[z]) & ~brick_.known[round_].words[z];
    learn(wanted);
  }

  /// Nothing grows from the last round, and most of what it would reach lies beyond the band. Learns of what may lie in
  /// it; of the rest the side is that of the voxels beside.
  void learn_last() {
    const BlockMask outside = beside_sources(0), inside = beside_sources(1);
    const BlockMask oblique = bits::dilate(around([](const Brick& b) -> const BlockMask& { return b.oblique; }));
    const BlockMask straight =
        bits::dilate_by_faces(around([](const Brick& b) -> const BlockMask& { return b.straight; }));
    BlockMask wanted, beyond, beyond_inside;
    for (int z = begin_; z < end_; ++z) {
      const std::uint64_t all = (outside.words[z] | inside.words[z]) & ~brick_.known[round_].words[z];
      const std::uint64_t doubtful =
          (outside.words[z] & inside.words[z]) | brick_.contested.words[z] | brick_.repaired.words[z];
      wanted.words[z] = all & (oblique.words[z] | straight.words[z] | doubtful);
      beyond.words[z] = all & ~wanted.words[z];
      beyond_inside.words[z] = beyond.words[z] & inside.words[z];
    }
    learn(wanted);
    if (!beyond.any() || !brick_.active.any()) return;
    if (sides_depend_on(beyond, beyond_inside)) {
      learn(beyond);
      return;
    }
    for (int z = begin_; z < end_; ++z) {
      brick_.known[round_].words[z] |= beyond.words[z];
      brick_.negative.words[z] |= beyond_inside.words[z];
    }
  }

  /// Whether voxels that nobody knows would change sides if these were known, as not all of them may be.
  [[nodiscard]] bool sides_depend_on(const BlockMask& beyond, const BlockMask& beyond_inside) const {
    const BlockMask& known = brick_.known[round_];
    BlockMask more_negative = brick_.negative, more_known = known;
    for (int z = begin_; z < end_; ++z) {
      more_negative.words[z] |= beyond_inside.words[z];
      more_known.words[z] |= beyond.words[z];
    }
    return bits::fill_sides(more_negative, more_known) != bits::fill_sides(brick_.negative, known);
  }

  /// Sums what the sources of a round say to the voxels wanted.
  void gather(int round, const BlockMask& wanted) {
    const Targets targets(wanted, begin_, end_);
    // Where one of them may be beside, a layer beyond the brick included. Of the bricks around only what touches this
    // one counts.
    const std::array<std::uint64_t, 10> beside = bits::dilate_alone(wanted);
    const auto touching = [&beside](int dx, int dy, int z) {
      std::uint64_t w = beside[static_cast<std::size_t>(z + 1)];
      if (dx != 0) w = dx < 0 ? (w & bits::columns_below(1)) << 7 : w >> 7 & bits::columns_below(1);
      return dy == 0 ? w : dy < 0 ? w << 56 : w >> 56;
    };
    // Their values are on the way from memory while the next are looked for.
    std::array<Source, 32> waiting;
    std::size_t count = 0;
    for (int i = 0; i < 27; ++i) {
      const Brick* const from = brick_.around[i];
      if (from == nullptr) continue;
      const auto& sources = from->source[static_cast<std::size_t>(round)];
      const int dx = i % 3 - 1, dy = i / 3 % 3 - 1, dz = i / 9 - 1;
      for (int z = std::max(begin_ - 1, dz * 8); z < std::min(end_ + 1, dz * 8 + 8); ++z) {
        for (std::uint64_t w = (sources[0].words[z & 7] | sources[1].words[z & 7]) & touching(dx, dy, z); w != 0;
             w &= w - 1) {
          const int bit = std::countr_zero(w), x = (bit & 7) + 8 * dx, y = (bit >> 3) + 8 * dy;
          const PairBits pairs = targets.around(x, y, z);
          if (!pairs.any()) continue;
          const int at = (z & 7) * 64 + bit;
          __builtin_prefetch(&from->plane[at]);
          waiting[count++] = {from, pairs, static_cast<std::int16_t>(at),
                              static_cast<std::int16_t>(x + 8 * y + 64 * z)};
          if (count < waiting.size()) continue;
          extrapolate({waiting.data(), count}, channels_, sums_);
          count = 0;
        }
      }
    }
    extrapolate({waiting.data(), count}, channels_, sums_);
  }

  void repair_gaps() {
    for (int z = begin_; z < end_; ++z) {
      LayerMasks masks(round_, growth_);
      for (std::uint64_t w = brick_.repaired.words[z] & ~brick_.known[1].words[z]; w != 0; w &= w - 1) {
        const int bit = std::countr_zero(w);
        if (const auto plane = repair(z * 64 + bit)) masks.add(bit, *plane);
      }
      brick_.know(z, masks);
    }
  }

  /// A gap between samples that extraction bridges. As corner_value() does it: the mean of all neighbours' planes,
  /// weights 1 / m^2.
  std::optional<Plane> repair(int at) {
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
  Sums& sums_;
};

}  // namespace

void extrapolate(std::span<const Source> sources, std::size_t channels, Sums& sums) {
  for (const Source& source : sources) add_pairs(source, source.from->plane[source.at], channels, sums);
}

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
    Step(*jobs[j].brick, round, jobs[j].begin, jobs[j].end, settings_, sums).run();
  });
}

}  // namespace lamina::volume

// The band grows: a known voxel gives those that lie beyond it along its normal the distance of its tangent plane.
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>

#include "volume/band.h"
#include "window/bits.h"

namespace lamina::volume {
namespace {

using Around = std::array<const Brick*, 27>;

struct Offset {
  int x, y, z;
  float squared;  ///< length
};

/// The middle is one of them, and out of everybody's reach.
constexpr std::array<Offset, 27> make_offsets() {
  std::array<Offset, 27> out{};
  for (int i = 0; i < 27; ++i) {
    const int x = i % 3 - 1, y = i / 3 % 3 - 1, z = i / 9 - 1;
    out[static_cast<std::size_t>(i)] = {x, y, z, static_cast<float>(x * x + y * y + z * z)};
  }
  return out;
}
constexpr std::array<Offset, 27> kOffsets = make_offsets();
constexpr std::uint32_t kMiddle = 13;

/// A voxel reaches another as far as the way to it leads along its normal: squared sideways distance below this. The
/// best of 26 directions is off by 0.35 at most; a whole voxel sideways would let the band grow over a rim.
constexpr float kSideways = 0.75F;
/// Repaired corners count within this distance of the surface, voxels.
constexpr float kRepaired = 1;

float sideways(const Offset& o, const std::array<float, 3>& n) {
  const float along = n[0] * static_cast<float>(o.x) + n[1] * static_cast<float>(o.y) + n[2] * static_cast<float>(o.z);
  return along > 0 ? o.squared - along * along : o.squared;
}

/// The offsets that a normal may reach, by the sixteenths its components lie in.
class Reach {
 public:
  Reach() {
    for (int i = 0; i < 4096; ++i) {
      std::array<float, 3> n{};
      float squared = 0;
      for (int k = 0; k < 3; ++k) {
        n[k] = (static_cast<float>(i >> (4 * k) & 15) + 0.5F) / 8 - 1;
        squared += n[k] * n[k];
      }
      for (float& c : n) c /= std::sqrt(squared);
      // A component may differ by a sixteenth from the middle.
      constexpr float kMargin = 0.3F;
      for (std::uint32_t o = 0; o < 27; ++o)
        if (o != kMiddle && sideways(kOffsets[o], n) < kSideways + kMargin) lists_[i] |= 1U << o;
    }
  }
  [[nodiscard]] std::uint32_t of(const std::array<float, 3>& n) const {
    int at = 0;
    for (int k = 0; k < 3; ++k) at |= std::clamp(static_cast<int>((n[k] + 1) * 8), 0, 15) << (4 * k);
    return lists_[at];
  }

 private:
  std::array<std::uint32_t, 4096> lists_{};
};

const Reach& reach() {
  static const Reach table;
  return table;
}

/// Weighted sums at the voxels of a brick.
struct Sums {
  std::array<float, 512> weight, distance;
  std::array<std::array<float, 512>, 3> normal;
  std::vector<float> extra;

  void clear(int at, std::size_t channels) {
    weight[at] = distance[at] = 0;
    for (auto& n : normal) n[at] = 0;
    extra.resize(std::max(extra.size(), 512 * channels));
    for (std::size_t c = 0; c < channels; ++c) extra[c * 512 + at] = 0;
  }
  void add(int at, float w, float d, const std::array<float, 3>& n, const Brick& from, int from_at,
           std::size_t channels) {
    weight[at] += w;
    distance[at] += w * d;
    for (std::size_t k = 0; k < 3; ++k) normal[k][at] += w * n[k];
    for (std::size_t c = 0; c < channels; ++c) extra[c * 512 + at] += w * from.extra[c * 512 + from_at];
  }
  /// False where neighbours of two sheets that face each other say nothing together.
  bool store(int at, float least, std::size_t channels, Brick& to) const {
    const float squared = normal[0][at] * normal[0][at] + normal[1][at] * normal[1][at] + normal[2][at] * normal[2][at];
    if (!(squared > least * least * weight[at] * weight[at])) return false;
    const float inverse = 1 / weight[at], unit = Brick::kUnit / std::sqrt(squared);
    to.distance[at] = distance[at] * inverse;
    for (std::size_t k = 0; k < 3; ++k) to.normal[k][at] = static_cast<std::int16_t>(std::lrint(normal[k][at] * unit));
    for (std::size_t c = 0; c < channels; ++c) to.extra[c * 512 + at] = extra[c * 512 + at] * inverse;
    return true;
  }
};

bits::Neighbourhood masks(const Around& around, int round) {
  bits::Neighbourhood n{};
  for (int i = 0; i < 27; ++i) n[i / 9][i / 3 % 3][i % 3] = around[i] == nullptr ? nullptr : &around[i]->known[round];
  return n;
}

/// One step of one brick: from the voxels that are known, in a fixed order, to those beside them that are not.
class Step {
 public:
  Step(const Around& around, int round, int begin, int end, const BandSettings& settings, Sums& sums)
      : around_(around),
        round_(round),
        begin_(begin),
        end_(end),
        channels_(settings.channels.size()),
        farthest_(static_cast<float>(settings.band) - 0.25F),
        sums_(sums) {}

  void run(Brick& brick) {
    const bits::Neighbourhood before = masks(around_, round_ - 1);
    bool any = false;
    for (int z = begin_; z < end_; ++z) {
      wanted_.words[z] = bits::dilate_layer(before, z, -1, 1) & ~brick.known[round_ - 1].words[z];
      any = any || wanted_.words[z] != 0;
      for (std::uint64_t w = wanted_.words[z]; w != 0; w &= w - 1) sums_.clear(z * 64 + std::countr_zero(w), channels_);
      brick.known[round_].words[z] = brick.known[round_ - 1].words[z];
    }
    if (!any) return;
    for (int z = begin_; z < end_; ++z)
      for (int y = 0; y < 8; ++y)
        rows_[z + 2][y + 2] = static_cast<std::uint32_t>(wanted_.words[z] >> (8 * y) & 0xFF) << 2;
    for (int i = 0; i < 27; ++i)
      if (around_[i] != nullptr) push_from(*around_[i], i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
    for (int z = begin_; z < end_; ++z) {
      for (std::uint64_t w = wanted_.words[z]; w != 0; w &= w - 1) {
        const int at = z * 64 + std::countr_zero(w);
        const bool reached = sums_.weight[at] > 0 && sums_.store(at, 0.5F, channels_, brick);
        if (reached || (round_ == 1 && brick.repaired.test(at) && repair(at, brick)))
          brick.known[round_].words[z] |= w & (~w + 1);
      }
    }
  }

 private:
  /// Whether any voxel wanted lies next to the neighbour in that direction.
  [[nodiscard]] bool touches(int dx, int dy) const {
    std::uint64_t w = ~std::uint64_t{0};
    if (dx != 0) w &= dx < 0 ? 0x0101010101010101ULL : 0x8080808080808080ULL;
    if (dy != 0) w &= dy < 0 ? 0x00000000000000FFULL : 0xFF00000000000000ULL;
    for (int z = begin_; z < end_; ++z)
      if ((wanted_.words[z] & w) != 0) return true;
    return false;
  }

  void push_from(const Brick& from, int dx, int dy, int dz) {
    if (!touches(dx, dy)) return;
    bits::Neighbourhood wanted{};
    wanted[1 - dz][1 - dy][1 - dx] = &wanted_;
    for (int z = std::max(begin_ - 1, dz * 8); z < std::min(end_ + 1, dz * 8 + 8); ++z) {
      const int own_z = z - dz * 8;
      std::uint64_t w = from.known[round_ - 1].words[own_z];
      if (dx < 0) w &= 0x8080808080808080ULL;
      if (dx > 0) w &= 0x0101010101010101ULL;
      if (dy < 0) w &= 0xFF00000000000000ULL;
      if (dy > 0) w &= 0x00000000000000FFULL;
      if (w != 0) w &= bits::dilate_layer(wanted, own_z, -1, 1);
      for (; w != 0; w &= w - 1) {
        const int bit = std::countr_zero(w);
        push(from, own_z * 64 + bit, (bit & 7) + dx * 8, (bit >> 3) + dy * 8, z);
      }
    }
  }

  /// The offsets from a voxel, of this brick or beside it, that lead to voxels wanted.
  [[nodiscard]] std::uint32_t wanted_beside(int x, int y, int z) const {
    std::uint32_t out = 0;
    for (int i = 0; i < 9; ++i) {
      const std::uint32_t row = rows_[z + 1 + i / 3][y + 1 + i % 3];
      out |= (row >> (x + 1) & 7U) << (3 * i);
    }
    return out;
  }

  /// Away from the surface only: what lies towards it is a hole in the data, not a part of the band.
  void push(const Brick& from, int from_at, int x, int y, int z) {
    const float d = from.distance[from_at];
    if (!(std::abs(d) < farthest_)) return;
    const std::uint32_t beside = wanted_beside(x, y, z);
    if (beside == 0) return;
    const float side = d < 0 ? -1.0F : 1.0F;
    const std::array<float, 3> n{from.normal_at(0, from_at), from.normal_at(1, from_at), from.normal_at(2, from_at)};
    const std::array<float, 3> away{side * n[0], side * n[1], side * n[2]};
    for (std::uint32_t list = reach().of(away) & beside; list != 0; list &= list - 1) {
      const Offset& o = kOffsets[static_cast<std::size_t>(std::countr_zero(list))];
      const float off = sideways(o, away);
      if (!(off < kSideways)) continue;
      const int at = BlockMask::offset(x + o.x, y + o.y, z + o.z);
      const float along = side * std::sqrt(o.squared - off);
      const float w = (kSideways - off) * (kSideways - off);
      sums_.add(at, w * w, d + along, n, from, from_at, channels_);
    }
  }

  /// A gap between samples that extraction bridges. As corner_value() does it: the mean of all neighbours' planes,
  /// weights 1 / m^2.
  bool repair(int at, Brick& brick) {
    sums_.clear(at, channels_);
    for (const Offset& o : kOffsets) {
      if (o.squared == 0) continue;
      const int x = (at & 7) + o.x, y = (at >> 3 & 7) + o.y, z = (at >> 6) + o.z;
      const Brick* from = around_[(x >> 3) + 1 + 3 * ((y >> 3) + 1) + 9 * ((z >> 3) + 1)];
      const int from_at = BlockMask::offset(x & 7, y & 7, z & 7);
      if (from == nullptr || !from->known[0].test(from_at)) continue;
      const std::array<float, 3> n{from->normal_at(0, from_at), from->normal_at(1, from_at),
                                   from->normal_at(2, from_at)};
      const float along =
          -(n[0] * static_cast<float>(o.x) + n[1] * static_cast<float>(o.y) + n[2] * static_cast<float>(o.z));
      sums_.add(at, 1 / (o.squared * o.squared), from->distance[from_at] + along, n, *from, from_at, channels_);
    }
    return sums_.weight[at] > 0 && std::abs(sums_.distance[at]) <= kRepaired * sums_.weight[at] &&
           sums_.store(at, 1e-6F, channels_, brick);
  }

  const Around& around_;
  int round_, begin_, end_;
  std::size_t channels_;
  float farthest_;  ///< a step along the normal, half a voxel at least, leads out of the band from here
  Sums& sums_;
  BlockMask wanted_;
  std::array<std::array<std::uint32_t, 12>, 12> rows_{};  ///< of wanted_, [z + 2][y + 2], bit x + 2
};

}  // namespace

void Band::grow(int round, std::int32_t begin, std::int32_t end) {
  struct Job {
    Brick* brick;
    int begin, end;
  };
  std::vector<Job> jobs;
  for (std::int32_t bz = begin >> 3; bz <= (end - 1) >> 3; ++bz) {
    const auto layer = layers_.find(bz);
    if (layer == layers_.end()) continue;
    for (auto& [key, brick] : layer->second)
      jobs.push_back({brick.get(), std::max(0, begin - bz * 8), std::min(8, end - bz * 8)});
  }
  tbb::parallel_for(std::size_t{0}, jobs.size(), [&](std::size_t j) {
    static thread_local Sums sums;
    const Job& job = jobs[j];
    const Block& b = job.brick->block;
    Around around;
    for (int i = 0; i < 27; ++i) around[i] = find({b.x + i % 3 - 1, b.y + i / 3 % 3 - 1, b.z + i / 9 - 1});
    Step(around, round, job.begin, job.end, settings_, sums).run(*job.brick);
  });
}

}  // namespace lamina::volume

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
typedef float Float4 __attribute__((vector_size(16)));  // NOLINT(modernize-use-using): attributes on typedefs

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

/// A voxel reaches another as far as the way to it leads along its normal: squared sideways distance below this. The
/// best of 26 directions is off by 0.35 at most; a whole voxel sideways would let the band grow over a rim.
constexpr float kSideways = 0.75F;
/// Repaired corners count within this distance of the surface, voxels.
constexpr float kRepaired = 1;

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
      for (std::uint32_t o = 0; o < 27; ++o) {
        const Offset& to = kOffsets[o];
        const float along =
            n[0] * static_cast<float>(to.x) + n[1] * static_cast<float>(to.y) + n[2] * static_cast<float>(to.z);
        const float off = along > 0 ? to.squared - along * along : to.squared;
        if (to.squared > 0 && off < kSideways + kMargin) lists_[i] |= 1U << o;
      }
    }
  }
  /// Of a brick's normal, or the one against it.
  [[nodiscard]] std::uint32_t of(int x, int y, int z, bool against) const {
    const int turn = against ? -1 : 0;
    const auto sixteenth = [turn](int n) { return ((n ^ turn) + 0x8000) >> 12; };
    return lists_[static_cast<std::size_t>(sixteenth(x) | sixteenth(y) << 4 | sixteenth(z) << 8)];
  }

 private:
  std::array<std::uint32_t, 4096> lists_{};
};

const Reach& reach() {
  static const Reach table;
  return table;
}

/// A brick and a voxel's layer around it: ten voxels a side, the brick's begin at 1.
constexpr int kSide = 10, kPlane = kSide * kSide, kVoxels = kPlane * kSide;
constexpr int padded(int x, int y, int z) {
  return x + 1 + kSide * (y + 1) + kPlane * (z + 1);
}

/// Where the voxels lie in the bricks around.
struct Source {
  std::uint8_t brick;
  std::uint16_t offset;
};
constexpr std::array<Source, kVoxels> make_sources() {
  std::array<Source, kVoxels> out{};
  for (int z = -1; z <= 8; ++z)
    for (int y = -1; y <= 8; ++y)
      for (int x = -1; x <= 8; ++x)
        out[static_cast<std::size_t>(padded(x, y, z))] = {
            static_cast<std::uint8_t>(((x + 8) >> 3) + 3 * ((y + 8) >> 3) + 9 * ((z + 8) >> 3)),
            static_cast<std::uint16_t>(BlockMask::offset(x & 7, y & 7, z & 7))};
  return out;
}
constexpr std::array<Source, kVoxels> kSources = make_sources();

/// Weighted sums at the voxels of a brick.
struct Sums {
  std::array<float, 512> weight;
  std::array<Float4, 512> total;  ///< normal and distance
  std::vector<float> extra;

  void clear(int at, std::size_t channels) {
    weight[at] = 0;
    total[at] = Float4{};
    extra.resize(std::max(extra.size(), 512 * channels));
    for (std::size_t c = 0; c < channels; ++c) extra[c * 512 + at] = 0;
  }
  void add(int at, float w, const Float4& plane, const Brick& from, int from_at, std::size_t channels) {
    weight[at] += w;
    total[at] += w * plane;
    for (std::size_t c = 0; c < channels; ++c) extra[c * 512 + at] += w * from.extra[c * 512 + from_at];
  }
  /// False where neighbours of two sheets that face each other say nothing together.
  bool store(int at, float least, std::size_t channels, Brick& to) const {
    const Float4 t = total[at], squares = t * t;
    const float squared = squares[0] + squares[1] + squares[2];
    if (!(squared > least * least * weight[at] * weight[at])) return false;
    const float inverse = 1 / weight[at], unit = Brick::kUnit / std::sqrt(squared);
    to.distance[at] = t[3] * inverse;
    for (int k = 0; k < 3; ++k) to.normal[k][at] = packed_normal(t[k] * unit);
    for (std::size_t c = 0; c < channels; ++c) to.extra[c * 512 + at] = extra[c * 512 + at] * inverse;
    return true;
  }
};

/// One bit for each of the voxels around a brick: a row of ten along x.
using Rows = std::array<std::uint32_t, kPlane>;  // [z + 1][y + 1], bit x + 1

/// One step of one brick: from the voxels that the step before made known, in a fixed order, to those beside them that
/// are not. What older voxels reach is known already, but for places between two sheets that face each other.
class Step {
 public:
  Step(const Around& around, int round, int begin, int end, const BandSettings& settings, float farthest, Sums& sums)
      : around_(around),
        round_(round),
        begin_(begin),
        end_(end),
        channels_(settings.channels.size()),
        farthest_(farthest),
        sums_(sums) {}

  void run(Brick& brick) {
    for (int z = begin_; z < end_; ++z) brick.known[round_].words[z] = brick.known[round_ - 1].words[z];
    BlockMask wanted, contested;
    bits::Neighbourhood fresh{};
    for (int i = 0; i < 27; ++i)
      if (around_[i] != nullptr) fresh[i / 9][i / 3 % 3][i % 3] = &around_[i]->source[round_ - 1];
    bits::dilate_layers<-1, 1>(fresh, begin_, end_, wanted.words.data() + begin_);
    for (int z = begin_; z < end_; ++z) {
      wanted.words[z] &= ~brick.known[round_ - 1].words[z];
      contested.words[z] = wanted.words[z] & brick.contested.words[z];
    }
    if (wanted.any()) {
      for_each(wanted, [&](int at) { sums_.clear(at, channels_); });
      push(rows_of(round_ - 1), wanted);
      for (int r = 0; contested.any() && r < round_ - 1; ++r) push(rows_of(r), contested);
      for_each(wanted, [&](int at) {
        if (!(sums_.weight[at] > 0)) return;
        if (sums_.store(at, 0.5F, channels_, brick)) {
          know(at, brick);
        } else {
          brick.contested.set(at);
        }
      });
    }
    if (round_ == 1) repair_gaps(brick);
  }

 private:
  template <class Visit>
  void for_each(const BlockMask& mask, const Visit& visit) const {
    for (int z = begin_; z < end_; ++z)
      for (std::uint64_t w = mask.words[z]; w != 0; w &= w - 1) visit(z * 64 + std::countr_zero(w));
  }

  [[nodiscard]] Rows rows_of(int round) const {
    Rows rows{};
    for (int i = 0; i < 27; ++i) {
      if (around_[i] == nullptr) continue;
      const BlockMask& source = around_[i]->source[round];
      const int dx = i % 3 - 1, dy = i / 3 % 3 - 1, dz = i / 9 - 1;
      const int y_begin = dy < 0 ? 7 : 0, y_end = dy > 0 ? 1 : 8;
      for (int z = std::max(begin_ - 1, dz * 8); z < std::min(end_ + 1, dz * 8 + 8); ++z) {
        const std::uint64_t w = source.words[z & 7];
        if (w == 0) continue;
        for (int y = y_begin; y < y_end; ++y) {
          const auto row = static_cast<std::uint32_t>(w >> (8 * y) & 0xFF);
          rows[static_cast<std::size_t>((z + 1) * kSide + y + 8 * dy + 1)] |=
              dx == 0 ? row << 1 : (dx < 0 ? row >> 7 : (row & 1) << 9);
        }
      }
    }
    return rows;
  }

  void push(const Rows& sources, const BlockMask& wanted) {
    // With another layer around, so that every source has neighbours.
    constexpr int kWide = 12;
    std::array<std::uint32_t, kWide * kWide> rows{}, near{};
    for (int z = begin_; z < end_; ++z)
      for (int y = 0; y < 8; ++y)
        rows[static_cast<std::size_t>((z + 2) * kWide + y + 2)] =
            static_cast<std::uint32_t>(wanted.words[z] >> (8 * y) & 0xFF) << 2;
    for (std::size_t i = begin_ * kWide + 2 * kWide; i < static_cast<std::size_t>((end_ + 2) * kWide); ++i) {
      const std::uint32_t row = rows[i] | rows[i - 1] | (i + 1 < rows.size() ? rows[i + 1] : 0);
      near[i] = row >> 1 | row | row << 1;
    }
    for (int z = begin_ - 1; z <= end_; ++z) {
      for (int y = -1; y <= 8; ++y) {
        const auto r = static_cast<std::size_t>((z + 1) * kSide + y + 1);
        const auto at = static_cast<std::size_t>((z + 2) * kWide + y + 2);
        std::uint32_t row = sources[r] & (near[at - kWide] | near[at] | near[at + kWide]) >> 1;
        for (; row != 0; row &= row - 1) {
          const int x = std::countr_zero(row) - 1;
          std::uint32_t beside = 0;
          for (std::size_t i = 0; i < 9; ++i)
            beside |= (rows[at + kWide * (i / 3) + i % 3 - kWide - 1] >> (x + 1) & 7U) << (3 * i);
          push_one(kSources[r * kSide + static_cast<std::size_t>(x + 1)], beside, x, y, z);
        }
      }
    }
  }

  /// Away from the surface only: what lies towards it is a hole in the data, not a part of the band.
  void push_one(const Source& source, std::uint32_t beside, int x, int y, int z) {
    const Brick& from = *around_[source.brick];
    const int nx = from.normal[0][source.offset], ny = from.normal[1][source.offset],
              nz = from.normal[2][source.offset];
    const float d = from.distance[source.offset];
    std::uint32_t list = beside & reach().of(nx, ny, nz, d < 0);
    if (list == 0) return;
    constexpr float kScale = 1 / Brick::kUnit;
    const Float4 plane{static_cast<float>(nx) * kScale, static_cast<float>(ny) * kScale,
                       static_cast<float>(nz) * kScale, d};
    const int here = BlockMask::offset(x, y, z);
    for (; list != 0; list &= list - 1) {
      const Offset& o = kOffsets[static_cast<std::size_t>(std::countr_zero(list))];
      const float up =
          plane[0] * static_cast<float>(o.x) + plane[1] * static_cast<float>(o.y) + plane[2] * static_cast<float>(o.z);
      const float near = kSideways - o.squared + up * up;
      if (!(near > 0) || (d < 0 ? up >= 0 : up <= 0)) continue;
      const float w = near * near;
      sums_.add(here + o.x + 8 * o.y + 64 * o.z, w * w, plane + Float4{0, 0, 0, up}, from, source.offset, channels_);
    }
  }

  void know(int at, Brick& brick) const {
    brick.known[round_].set(at);
    if (std::abs(brick.distance[at]) < farthest_) brick.source[round_].set(at);
  }

  void repair_gaps(Brick& brick) {
    for (int z = begin_; z < end_; ++z) {
      for (std::uint64_t w = brick.repaired.words[z] & ~brick.known[1].words[z]; w != 0; w &= w - 1) {
        const int at = z * 64 + std::countr_zero(w);
        if (repair(at, brick)) know(at, brick);
      }
    }
  }

  /// A gap between samples that extraction bridges. As corner_value() does it: the mean of all neighbours' planes,
  /// weights 1 / m^2.
  bool repair(int at, Brick& brick) {
    const int here = padded(at & 7, at >> 3 & 7, at >> 6);
    sums_.clear(at, channels_);
    for (const Offset& o : kOffsets) {
      if (o.squared == 0) continue;
      const int place = here + o.x + kSide * o.y + kPlane * o.z;
      const Source& s = kSources[static_cast<std::size_t>(place)];
      const Brick* from = around_[s.brick];
      if (from == nullptr || !from->known[0].test(s.offset)) continue;
      const std::array<float, 3> n{from->normal_at(0, s.offset), from->normal_at(1, s.offset),
                                   from->normal_at(2, s.offset)};
      const float along =
          -(n[0] * static_cast<float>(o.x) + n[1] * static_cast<float>(o.y) + n[2] * static_cast<float>(o.z));
      sums_.add(at, 1 / (o.squared * o.squared), Float4{n[0], n[1], n[2], from->distance[s.offset] + along}, *from,
                s.offset, channels_);
    }
    return sums_.weight[at] > 0 && std::abs(sums_.total[at][3]) <= kRepaired * sums_.weight[at] &&
           sums_.store(at, 1e-6F, channels_, brick);
  }

  const Around& around_;
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
    Step(around, round, job.begin, job.end, settings_, farthest_, sums).run(*job.brick);
  });
}

}  // namespace lamina::volume

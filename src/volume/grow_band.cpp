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

/// A brick and a voxel's layer around it: ten voxels a side, the brick's begin at 1.
constexpr int kSide = 10, kPlane = kSide * kSide, kVoxels = kPlane * kSide;
constexpr int padded(int x, int y, int z) {
  return x + 1 + kSide * (y + 1) + kPlane * (z + 1);
}

/// From a voxel to its neighbour, and the vector back.
struct Way {
  Float4 back;
  float squared;
  int step;
};
constexpr std::array<Way, 27> make_ways() {
  std::array<Way, 27> out{};
  for (std::size_t i = 0; i < 27; ++i) {
    const Offset& o = kOffsets[i];
    out[i].back = Float4{static_cast<float>(-o.x), static_cast<float>(-o.y), static_cast<float>(-o.z), 0};
    out[i].squared = o.squared;
    out[i].step = o.x + kSide * o.y + kPlane * o.z;
  }
  return out;
}
constexpr std::array<Way, 27> kWays = make_ways();

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

/// A voxel reaches another as far as the way to it leads along its normal: squared sideways distance below this. The
/// best of 26 directions is off by 0.35 at most; a whole voxel sideways would let the band grow over a rim.
constexpr float kSideways = 0.75F;
/// Repaired corners count within this distance of the surface, voxels.
constexpr float kRepaired = 1;

/// What neighbours say about one voxel, weighted.
struct Sum {
  float weight = 0;
  Float4 total{};  ///< normal and distance
  /// Who has said it, for the extra channels.
  std::array<std::uint16_t, 27> from;
  std::array<float, 27> share;
  int count = 0;

  void add(float w, const Float4& plane, int place) {
    weight += w;
    total += w * plane;
    from[static_cast<std::size_t>(count)] = static_cast<std::uint16_t>(place);
    share[static_cast<std::size_t>(count)] = w;
    count += w > 0;
  }
  /// False where neighbours of two sheets that face each other say nothing together.
  bool store(int at, float least, std::size_t channels, const Around& around, Brick& to) const {
    const float squared = total[0] * total[0] + total[1] * total[1] + total[2] * total[2];
    if (!(squared > least * least * weight * weight)) return false;
    const float inverse = 1 / weight, unit = Brick::kUnit / std::sqrt(squared);
    to.distance[at] = total[3] * inverse;
    for (std::size_t k = 0; k < 3; ++k) to.normal[k][at] = packed_normal(total[static_cast<int>(k)] * unit);
    for (std::size_t c = 0; c < channels; ++c) {
      float extra = 0;
      for (int i = 0; i < count; ++i) {
        const Source& s = kSources[from[i]];
        extra += share[i] * around[s.brick]->extra[c * 512 + s.offset];
      }
      to.extra[c * 512 + at] = extra * inverse;
    }
    return true;
  }
};

/// One bit for each of the voxels around a brick: a row of ten along x.
using Rows = std::array<std::uint32_t, kPlane>;  // [z + 1][y + 1], bit x + 1

/// One step of one brick: from the voxels that the step before made known, in a fixed order, to those beside them that
/// are not. What older voxels reach is known already, but for places between two sheets that face each other.
class Step {
 public:
  Step(const Around& around, int round, int begin, int end, const BandSettings& settings, float farthest)
      : around_(around),
        round_(round),
        begin_(begin),
        end_(end),
        channels_(settings.channels.size()),
        farthest_(farthest) {}

  void run(Brick& brick) {
    for (int z = begin_; z < end_; ++z) brick.known[round_].words[z] = brick.known[round_ - 1].words[z];
    std::array<std::uint64_t, 8> wanted{};
    bits::Neighbourhood fresh{};
    std::uint64_t any = 0;
    for (int i = 0; i < 27; ++i)
      if (around_[i] != nullptr) fresh[i / 9][i / 3 % 3][i % 3] = &around_[i]->source[round_ - 1];
    bits::dilate_layers<-1, 1>(fresh, begin_, end_, wanted.data() + begin_);
    std::uint64_t doubtful = 0;
    for (int z = begin_; z < end_; ++z) {
      wanted[z] &= ~brick.known[round_ - 1].words[z];
      any |= wanted[z];
      doubtful |= wanted[z] & brick.contested.words[z];
    }
    if (any != 0) {
      rows_ = rows_of(round_ - 1);
      read_planes(rows_);
      for (int r = 0; doubtful != 0 && r < round_ - 1; ++r) {
        const Rows older = rows_of(r);
        read_planes(older);
        for (std::size_t i = 0; i < older.size(); ++i) older_[i] |= older[i];
      }
      for (int z = begin_; z < end_; ++z) {
        for (std::uint64_t w = wanted[z]; w != 0; w &= w - 1) grow(z * 64 + std::countr_zero(w), brick);
      }
    }
    if (round_ == 1) repair_gaps(brick);
  }

 private:
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

  /// Neighbouring voxels ask for the same planes: they are unpacked once.
  void read_planes(const Rows& rows) {
    constexpr float kScale = 1 / Brick::kUnit;
    for (int r = begin_ * kSide; r < (end_ + 2) * kSide; ++r) {
      for (std::uint32_t row = rows[static_cast<std::size_t>(r)]; row != 0; row &= row - 1) {
        const auto place = static_cast<std::size_t>(r * kSide + std::countr_zero(row));
        const Source& s = kSources[place];
        const Brick& from = *around_[s.brick];
        planes_[place] = Float4{static_cast<float>(from.normal[0][s.offset]) * kScale,
                                static_cast<float>(from.normal[1][s.offset]) * kScale,
                                static_cast<float>(from.normal[2][s.offset]) * kScale, from.distance[s.offset]};
      }
    }
  }

  [[nodiscard]] static std::uint32_t beside(const Rows& rows, int x, int y, int z) {
    std::uint32_t out = 0;
    for (int i = 0; i < 9; ++i)
      out |= (rows[static_cast<std::size_t>((z + i / 3) * kSide + y + i % 3)] >> x & 7U) << (3 * i);
    return out;
  }

  /// Away from the surface only: what lies towards it is a hole in the data, not a part of the band.
  void grow(int at, Brick& brick) {
    const int x = at & 7, y = at >> 3 & 7, z = at >> 6;
    std::uint32_t list = beside(rows_, x, y, z);
    if (brick.contested.test(at)) list |= beside(older_, x, y, z);
    const int here = padded(x, y, z);
    Sum sum;
    for (; list != 0; list &= list - 1) {
      const Way& way = kWays[static_cast<std::size_t>(std::countr_zero(list))];
      const int place = here + way.step;
      const Float4 plane = planes_[static_cast<std::size_t>(place)];
      const Float4 product = plane * way.back;
      const float up = product[0] + product[1] + product[2];
      // Most neighbours have no say, and which do is hard to foresee: no branches.
      const float near = kSideways - way.squared + up * up;
      const float w = (up * plane[3] > 0 || (plane[3] == 0 && up > 0)) & (near > 0) ? near * near : 0.0F;
      sum.add(w * w, plane + Float4{0, 0, 0, up}, place);
    }
    if (!(sum.weight > 0)) return;
    if (sum.store(at, 0.5F, channels_, around_, brick)) {
      know(at, brick);
    } else {
      brick.contested.set(at);
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
  bool repair(int at, Brick& brick) const {
    const int here = padded(at & 7, at >> 3 & 7, at >> 6);
    Sum sum;
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
      sum.add(1 / (o.squared * o.squared), Float4{n[0], n[1], n[2], from->distance[s.offset] + along}, place);
    }
    return sum.weight > 0 && std::abs(sum.total[3]) <= kRepaired * sum.weight &&
           sum.store(at, 1e-6F, channels_, around_, brick);
  }

  const Around& around_;
  int round_, begin_, end_;
  std::size_t channels_;
  float farthest_;
  Rows rows_{}, older_{};
  std::array<Float4, kVoxels> planes_;  ///< written where a row has a bit
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
    const Job& job = jobs[j];
    const Block& b = job.brick->block;
    Around around;
    for (int i = 0; i < 27; ++i) around[i] = find({b.x + i % 3 - 1, b.y + i / 3 % 3 - 1, b.z + i / 9 - 1});
    Step(around, round, job.begin, job.end, settings_, farthest_).run(*job.brick);
  });
}

}  // namespace lamina::volume

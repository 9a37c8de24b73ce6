// The band grows: a voxel beside known ones takes its distance from their tangent planes.
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "volume/band.h"
#include "window/bits.h"

namespace lamina::volume {
namespace {

constexpr int kRow = 10, kPlane = kRow * kRow;

/// A brick's known voxels and one around it, dense: [z + 1][y + 1][x + 1].
struct Field {
  std::array<float, 10 * kPlane> distance;
  std::array<std::array<float, 10 * kPlane>, 3> normal;
  std::array<bool, 10 * kPlane> known;
};

using Around = std::array<const Brick*, 27>;

void gather(const Around& around, int round, int begin, int end, Field& f) {
  std::fill(f.known.begin() + begin * kPlane, f.known.begin() + (end + 2) * kPlane, false);
  for (int i = 0; i < 27; ++i) {
    const Brick* brick = around[i];
    if (brick == nullptr) continue;
    const int dx = i % 3 - 1, dy = i / 3 % 3 - 1, dz = i / 9 - 1;
    for (int z = std::max(begin - 1, dz * 8); z < std::min(end + 1, dz * 8 + 8); ++z) {
      std::uint64_t w = brick->known[round].words[z - dz * 8];
      if (dx < 0) w &= 0x8080808080808080ULL;
      if (dx > 0) w &= 0x0101010101010101ULL;
      if (dy < 0) w &= 0xFF00000000000000ULL;
      if (dy > 0) w &= 0x00000000000000FFULL;
      for (; w != 0; w &= w - 1) {
        const int bit = std::countr_zero(w), from = (z - dz * 8) * 64 + bit;
        const int at = (z + 1) * kPlane + ((bit >> 3) + dy * 8 + 1) * kRow + (bit & 7) + dx * 8 + 1;
        f.known[at] = true;
        f.distance[at] = brick->distance[from];
        for (int k = 0; k < 3; ++k) f.normal[k][at] = brick->normal_at(k, from);
      }
    }
  }
}

struct Offset {
  int at;         ///< in the field
  int x, y, z;    ///< of the neighbour
  float squared;  ///< length
};

constexpr std::array<Offset, 26> make_offsets() {
  std::array<Offset, 26> out{};
  std::size_t n = 0;
  for (int z = -1; z <= 1; ++z)
    for (int y = -1; y <= 1; ++y)
      for (int x = -1; x <= 1; ++x)
        if (x != 0 || y != 0 || z != 0)
          out[n++] = {z * kPlane + y * kRow + x, x, y, z, static_cast<float>(x * x + y * y + z * z)};
  return out;
}
constexpr std::array<Offset, 26> kOffsets = make_offsets();

/// A neighbour counts as far as the way from it leads along its normal: squared sideways distance below this, voxels.
/// The best of 26 directions is off by 0.35 at most; a whole voxel sideways would let the band grow over a rim.
constexpr float kSideways = 0.75F;

/// Repaired corners count within this distance of the surface, voxels; farther out the way along normals is exacter.
constexpr float kRepaired = 1;

struct Grown {
  float distance = 0;
  std::array<float, 3> normal{};
  std::array<float, 26> weight{};
};

bool normalise(float total, float least, Grown& out) {
  const float length = std::hypot(out.normal[0], out.normal[1], out.normal[2]);
  if (!(length > least * total)) return false;
  out.distance /= total;
  for (float& n : out.normal) n /= length;
  for (float& w : out.weight) w /= total;
  return true;
}

/// As corner_value() does it: the mean of all neighbours' planes, weights 1 / m^2.
bool repair(const Field& f, int at, Grown& out) {
  float total = 0;
  out = {};
  for (std::size_t i = 0; i < 26; ++i) {
    const Offset& o = kOffsets[i];
    const int from = at + o.at;
    if (!f.known[from]) continue;
    const float w = 1 / (o.squared * o.squared);
    const std::array<float, 3> n{f.normal[0][from], f.normal[1][from], f.normal[2][from]};
    out.weight[i] = w;
    total += w;
    out.distance += w * (f.distance[from] - n[0] * static_cast<float>(o.x) - n[1] * static_cast<float>(o.y) -
                         n[2] * static_cast<float>(o.z));
    for (std::size_t k = 0; k < 3; ++k) out.normal[k] += w * n[k];
  }
  return total > 0 && normalise(total, 1e-6F, out);
}

bool extend(const Field& f, int at, Grown& out) {
  float total = 0;
  out.distance = 0;
  out.normal = {};
  for (std::size_t i = 0; i < 26; ++i) {
    const Offset& o = kOffsets[i];
    out.weight[i] = 0;
    const int from = at + o.at;
    if (!f.known[from]) continue;
    const float nx = f.normal[0][from], ny = f.normal[1][from], nz = f.normal[2][from];
    // The way from the neighbour to the voxel.
    const float along = -(nx * static_cast<float>(o.x) + ny * static_cast<float>(o.y) + nz * static_cast<float>(o.z));
    const float d = f.distance[from];
    // Away from the surface only: what lies towards it is a hole in the data, not a part of the band.
    if (along * d < 0) continue;
    const float sideways = o.squared - along * along;
    if (!(sideways < kSideways)) continue;
    const float w = (kSideways - sideways) * (kSideways - sideways);
    out.weight[i] = w;
    total += w;
    out.distance += w * (d + along);
    out.normal[0] += w * nx;
    out.normal[1] += w * ny;
    out.normal[2] += w * nz;
  }
  // Neighbours of two sheets that face each other say nothing together.
  return total > 0 && normalise(total, 0.5F, out);
}

/// Extra channels follow the same weights; they are seldom asked for, and looked up where they lie.
void extend_extra(const Around& around, int x, int y, int z, const Grown& grown, std::size_t channels, Brick& brick) {
  for (std::size_t c = 0; c < channels; ++c) {
    float sum = 0;
    for (std::size_t i = 0; i < 26; ++i) {
      if (grown.weight[i] == 0) continue;
      const int nx = x + kOffsets[i].x, ny = y + kOffsets[i].y, nz = z + kOffsets[i].z;
      const Brick* from = around[(nx >> 3) + 1 + 3 * ((ny >> 3) + 1) + 9 * ((nz >> 3) + 1)];
      sum +=
          grown.weight[i] * from->extra[c * 512 + static_cast<std::size_t>(BlockMask::offset(nx & 7, ny & 7, nz & 7))];
    }
    brick.extra[c * 512 + static_cast<std::size_t>(BlockMask::offset(x, y, z))] = sum;
  }
}

bits::Neighbourhood masks(const Around& around, int round) {
  bits::Neighbourhood n{};
  for (int i = 0; i < 27; ++i) n[i / 9][i / 3 % 3][i % 3] = around[i] == nullptr ? nullptr : &around[i]->known[round];
  return n;
}

void grow_brick(const Around& around, int round, int begin, int end, std::size_t channels, Brick& brick) {
  static thread_local Field field;
  const bits::Neighbourhood before = masks(around, round - 1);
  bool gathered = false;
  for (int z = begin; z < end; ++z) {
    const std::uint64_t known = brick.known[round - 1].words[z];
    std::uint64_t now = known;
    for (std::uint64_t w = bits::dilate_layer(before, z, -1, 1) & ~known; w != 0; w &= w - 1) {
      if (!gathered) gather(around, round - 1, begin, end, field);
      gathered = true;
      const int bit = std::countr_zero(w), x = bit & 7, y = bit >> 3, at = z * 64 + bit;
      const int in_field = (z + 1) * kPlane + (y + 1) * kRow + x + 1;
      Grown grown;
      // Next to the surface the band agrees with the mesh.
      const bool here = round == 1 && brick.repaired.test(at) && repair(field, in_field, grown) &&
                        std::abs(grown.distance) <= kRepaired;
      if (!here && !extend(field, in_field, grown)) continue;
      now |= w & (~w + 1);
      brick.distance[at] = grown.distance;
      for (int k = 0; k < 3; ++k)
        brick.normal[k][at] = static_cast<std::int16_t>(std::lrint(grown.normal[k] * Brick::kUnit));
      if (channels > 0) extend_extra(around, x, y, z, grown, channels, brick);
    }
    brick.known[round].words[z] = now;
  }
}

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
    grow_brick(around, round, job.begin, job.end, settings_.channels.size(), *job.brick);
  });
}

}  // namespace lamina::volume

// The narrow band of a running reconstruction: how it grows beyond the cells at the surface, and its distances as the
// leaves of grids.
#pragma once
#include <xmmintrin.h>

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/frame.h"
#include "lattice/lattice.h"
#include "levelset/brick.h"
#include "octree/corner_block.h"
#include "octree/window.h"
#include "vdb/grids.h"
#include "vdb/streamed_vdb.h"

namespace lamina::volume {

struct Offset {
  int x, y, z;
  float squared;  ///< length
};

/// Rows along y, then x, then z. The middle is one of them, and gives itself nothing.
constexpr std::array<Offset, 27> make_offsets() {
  std::array<Offset, 27> out{};
  for (int i = 0; i < 27; ++i) {
    const int x = i / 3 % 3 - 1, y = i % 3 - 1, z = i / 9 - 1;
    out[static_cast<std::size_t>(i)] = {x, y, z, static_cast<float>(x * x + y * y + z * z)};
  }
  return out;
}
inline constexpr std::array<Offset, 27> kOffsets = make_offsets();

/// Offsets come in pairs: i behind the middle, its opposite i before it.
inline constexpr int kPairs = 13, kBehind = 14;
constexpr std::array<int, kPairs> make_pair_steps() {
  std::array<int, kPairs> out{};
  for (std::size_t i = 0; i < kPairs; ++i)
    out[i] = kOffsets[kBehind + i].x + 8 * kOffsets[kBehind + i].y + 64 * kOffsets[kBehind + i].z;
  return out;
}
inline constexpr std::array<int, kPairs> kPairSteps = make_pair_steps();  ///< in a brick, to the one behind

/// Bit i: the offset of pair i behind the middle, or before it.
struct PairBits {
  std::uint16_t behind = 0, before = 0;
  [[nodiscard]] bool any() const { return (behind | before) != 0; }
};

/// A voxel gives another a value where the way to it leads along its normal: squared sideways distance below this. The
/// best of 26 directions is off by 0.35 at most; a whole voxel sideways would let the band grow over a boundary.
inline constexpr float kSideways = 0.75F;

/// The pairs four at a time. What fills the last four lies too far sideways.
inline constexpr int kFours = 4;
struct FourPairs {
  Plane x, y, z, room;  ///< `room`: what is left of kSideways
};
constexpr std::array<FourPairs, kFours> make_fours() {
  std::array<FourPairs, kFours> out{};
  for (std::size_t i = 0; i < kFours; ++i) {
    std::array<Offset, 4> o{};
    for (std::size_t k = 0; k < 4; ++k) o[k] = 4 * i + k < kPairs ? kOffsets[4 * i + k + kBehind] : Offset{0, 0, 0, 1};
    const auto four = [&o](auto value) { return Plane{value(o[0]), value(o[1]), value(o[2]), value(o[3])}; };
    out[i] = {four([](const Offset& to) { return static_cast<float>(to.x); }),
              four([](const Offset& to) { return static_cast<float>(to.y); }),
              four([](const Offset& to) { return static_cast<float>(to.z); }),
              four([](const Offset& to) { return kSideways - to.squared; })};
  }
  return out;
}
inline constexpr std::array<FourPairs, kFours> kFourPairs = make_fours();

/// The nearer to the normal, the more.
inline float weight_of(float near) {
  return near * near * near * near;
}

/// The neighbours to which a voxel gives the distance of its tangent plane.
struct Stencil {
  /// The pairs of which one gets a value, and whether it is the one behind.
  std::uint32_t pairs = 0, behind = 0;
  /// By pair: the way to the one behind along the normal, and what kSideways leaves.
  alignas(16) std::array<float, std::size_t{4} * kFours> up, near;

  /// Away from the surface only: what lies towards it is a hole in the data, not a part of the band.
  explicit Stencil(const Plane& plane) {
    const auto signs = [](const Plane& four) {
      return static_cast<std::uint32_t>(_mm_movemask_ps(std::bit_cast<__m128>(four)));
    };
    for (std::size_t i = 0; i < kFours; ++i) {
      const FourPairs& to = kFourPairs[i];
      const Plane u = plane[0] * to.x + plane[1] * to.y + plane[2] * to.z;
      const Plane left = to.room + u * u;
      _mm_store_ps(&up[4 * i], std::bit_cast<__m128>(u));
      _mm_store_ps(&near[4 * i], std::bit_cast<__m128>(left));
      pairs |= signs(left) << (4 * i);
      behind |= signs(u) << (4 * i);
    }
    pairs = ~pairs;
    if (!(plane[3] < 0)) behind = ~behind;
  }
};

/// A voxel's eight bits of a row, three places apart.
constexpr std::array<std::uint32_t, 256> make_spread() {
  std::array<std::uint32_t, 256> out{};
  for (std::uint32_t row = 0; row < 256; ++row)
    for (std::uint32_t x = 0; x < 8; ++x) out[row] |= (row >> x & 1) << (3 * x);
  return out;
}
inline constexpr std::array<std::uint32_t, 256> kSpread = make_spread();

/// Nine bits backwards.
constexpr std::array<std::uint16_t, 512> make_backwards() {
  std::array<std::uint16_t, 512> out{};
  for (std::uint32_t nine = 0; nine < 512; ++nine)
    for (std::uint32_t i = 0; i < 9; ++i)
      out[nine] = static_cast<std::uint16_t>(out[nine] | (nine >> i & 1) << (8 - i));
  return out;
}
inline constexpr std::array<std::uint16_t, 512> kBackwards = make_backwards();

/// The voxels of a brick that want a value, laid out for those around a source to lie side by side.
class Targets {
 public:
  Targets(const BlockMask& wanted, int begin, int end) {
    for (int z = begin; z < end; ++z) {
      if (wanted.words[z] == 0) continue;
      for (int y = 0; y < 8; ++y) {
        const std::uint64_t row = std::uint64_t{kSpread[wanted.words[z] >> (8 * y) & 0xFF]} << 6;
        if (row == 0) continue;
        rows_[at(z, y - 1)] |= row << 2;
        rows_[at(z, y)] |= row << 1;
        rows_[at(z, y + 1)] |= row;
      }
    }
  }
  /// The voxel may lie one beside the brick.
  [[nodiscard]] PairBits around(int x, int y, int z) const {
    const int shift = 3 * (x + 1);
    const auto nine = [&](int layer) { return static_cast<std::uint32_t>(rows_[at(layer, y)] >> shift) & 0x1FF; };
    const std::uint32_t low = nine(z - 1), middle = nine(z), high = nine(z + 1);
    return {static_cast<std::uint16_t>(high << 4 | middle >> 5),
            static_cast<std::uint16_t>(std::uint32_t{kBackwards[low]} << 4 | kBackwards[middle] >> 5)};
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
  std::vector<float> extra;      ///< 512 for each channel

  void clear(int at, std::size_t channels) {
    weight[at] = 0;
    total[at] = Plane{};
    for (std::size_t c = 0; c < channels; ++c) extra[c * 512 + at] = 0;
  }
  void add(int at, float w, const Plane& plane, const Brick& from, int from_at, std::size_t channels) {
    weight[at] += w;
    total[at] += w * plane;
    for (std::size_t c = 0; c < channels; ++c) extra[c * 512 + at] += w * from.extra[c * 512 + from_at];
  }
};

/// A known voxel that others get values from.
struct Source {
  const Brick* from;
  PairBits wanted;        ///< who of those around wants one
  std::int16_t at, here;  ///< its place in its own brick, and as seen from the one of the sums
};

/// Adds what the sources' tangent planes say to the sums of the voxels around them.
void extrapolate(std::span<const Source> sources, std::size_t channels, Sums& sums);

// The narrow band around the surface at one lattice level: corners' own values, coarser and finer levels resampled, and
// what their planes say about the voxels around.

struct BandSettings {
  int level = 0;              ///< voxels are the corners of this level
  bool other_levels = true;   ///< take the values of other levels where this one has none
  double band = 3;            ///< half width, voxels: farther values are left out
  int rounds = 2;             ///< voxels by which the band grows along the normals beyond what was projected
  std::vector<int> channels;  ///< of the window (corner_block.h), beside distance and normal
};

inline Growth growth_of(const BandSettings& settings) {
  return {static_cast<float>(settings.band), settings.rounds};
}

class Band {
 public:
  Band(BandSettings settings, const Lattice& lattice);
  /// Takes the slab's corners, slab after slab. The slabs below and above must be finished, their values still there.
  void collect(const Window& window, std::int32_t slab);
  /// Bricks in which nothing changes any more, in canonical order (z, then as BrickMap has them); with `end`, all that
  /// are left.
  std::vector<Brick*> pop(bool end);
  /// Bricks that were popped and are done with.
  void give_back(const std::vector<Brick*>& bricks) { bricks_.give_back(bricks); }
  /// After pop(true): the memory of those given back.
  void free_spare() { bricks_.free_spare(); }
  [[nodiscard]] const BandSettings& settings() const { return settings_; }
  /// The mask of the whole band.
  [[nodiscard]] const BlockMask& all(const Brick& brick) const { return brick.known[settings_.rounds]; }

 private:
  struct Found;
  class CoarseCell;
  void collect_level(const Window& window, std::int32_t slab);
  void collect_finer(const Window& window, std::int32_t slab, int level);
  void collect_coarser(const Window& window, std::int32_t slab, int level);
  void put(const Found& found);
  void make_room(std::int32_t begin, std::int32_t end);
  void grow(int round, std::int32_t begin, std::int32_t end);
  void advance(bool end);

  BandSettings settings_;
  Lattice lattice_;
  BrickMap bricks_;
  std::int32_t known_end_ = 0;                       ///< planes below are collected
  std::array<std::int32_t, kMaxRounds + 1> done_{};  ///< planes below have had the round
  bool begun_ = false;
};

// From bricks of the band to the leaves of the grids: their index space, what they hold, and the leaves' bytes.

/// From the lattice of a run to the index space of its grids: these have the input's axes where the frame only permutes
/// them, else the frame's.
struct GridFrame {
  std::array<int, 3> axis_of{0, 1, 2};  ///< index axis of each lattice axis
  openvdb::math::Transform::Ptr transform;
  double voxel = 1;  ///< world units

  GridFrame(const Frame& frame, const Lattice& lattice, int level);
  [[nodiscard]] openvdb::Coord index(const Cell& c) const {
    openvdb::Coord out;
    out[axis_of[0]] = c.x;
    out[axis_of[1]] = c.y;
    out[axis_of[2]] = c.z;
    return out;
  }
};

/// A grid beside the distances: from the normals, or from channels of the window.
struct ExtraGrid {
  enum class Kind { normal, vector, scalar, weight };
  std::string name;
  Kind kind = Kind::scalar;
  std::array<int, 3> channels{};  ///< index into BandSettings::channels; one for scalars
  float scale = 1;                ///< values are multiplied by this
};

/// The grids called for, and the channels they need. Throws Error(usage) naming one that nobody knows.
std::vector<ExtraGrid> resolve_grids(const std::vector<std::string>& names, const AttributeLayout& layout, double step,
                                     std::vector<int>& channels);

struct BrickLeaves {
  bool any = false;
  std::vector<PackedLeaf> leaves;  ///< the distances', then one for each extra grid
};

class LeafMaker {
 public:
  /// `rotation`: of the frame.
  LeafMaker(const Band& band, const GridFrame& grid, const std::vector<ExtraGrid>& extras,
            const Eigen::Matrix3d& rotation, bool half);
  /// `out` may hold those of another brick, whose memory is used again.
  void operator()(const Brick& brick, BrickLeaves& out) const;

 private:
  /// Voxels of a brick in their leaf's order.
  using Order = std::span<const std::uint16_t>;
  void fill_scalars(const Brick& brick, const ExtraGrid& extra, Order order, float* values) const;
  void fill_vectors(const Brick& brick, const ExtraGrid& extra, Order order, float* values) const;

  const Band& band_;
  const GridFrame& grid_;
  const std::vector<ExtraGrid>& extras_;
  const Eigen::Matrix3d& rotation_;
  bool half_;
  std::array<int, 3> axes_{};                ///< where the brick's axes go in its leaf (with_axes())
  std::array<std::uint16_t, 512> voxel_at_;  ///< of the brick, for each place of the leaf
};

}  // namespace lamina::volume

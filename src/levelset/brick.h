// A piece of the band, and where its neighbours are.
#pragma once
#include <xmmintrin.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "octree/corner_block.h"
#include "octree/window.h"

namespace lamina::volume {

inline constexpr int kMaxRounds = 8;

/// What a voxel knows of the surface: its unit normal along the frame's axes, and the distance in voxels. Together, as
/// whoever reads one wants the other.
typedef float Plane __attribute__((vector_size(16)));  // NOLINT(modernize-use-using): attributes on typedefs

/// The band grows by steps that lead away from the surface by so much at least (Stencil in band.h), voxels;
/// those along two axes or three at once by more.
inline constexpr float kShortestStep = 0.5F, kShortestOblique = 1.118F;

/// How far the band grows.
struct Growth {
  float band = 3;  ///< half width, voxels
  int rounds = 2;
};

/// What the planes say that voxels of a layer get in a round, gathered without branches.
class LayerMasks {
 public:
  LayerMasks(int of_round, const Growth& growth)
      : round(static_cast<std::size_t>(of_round)),
        steps(of_round + 1 == growth.rounds),
        grows(of_round < growth.rounds),
        band_(growth.band) {}

  void add(int bit, const Plane& plane) {
    const float distance = plane[3], room = band_ - std::abs(distance);
    const auto set = [bit](bool on) { return std::uint64_t{on} << bit; };
    known |= set(true);
    active |= set(room > 0);
    negative |= set(distance < 0);
    source |= set(room > kShortestStep);
    if (!steps) return;
    oblique |= set(room > kShortestOblique);
    const auto up = _mm_andnot_ps(_mm_set1_ps(-0.0F), std::bit_cast<__m128>(plane));
    const auto stays = _mm_and_ps(_mm_cmpge_ps(up, _mm_set1_ps(kShortestStep)), _mm_cmple_ps(up, _mm_set1_ps(room)));
    straight |= set((_mm_movemask_ps(stays) & 7) != 0);
  }

  const std::size_t round;
  const bool steps;  ///< of the last round that anything grows from: `oblique` and `straight` are asked for
  const bool grows;  ///< anything grows from this round
  std::uint64_t known = 0, active = 0, negative = 0, source = 0, oblique = 0, straight = 0;

 private:
  float band_;
};

/// 8^3 voxels.
struct Brick {
  Block block;
  /// The bricks around, x fastest, itself in the middle; null where there is none.
  std::array<Brick*, 27> around;
  /// By round: the projected voxels first, the whole band last, there also voxels beyond it of which the side alone
  /// is known.
  std::array<BlockMask, kMaxRounds + 1> known;
  /// By round: the voxels new in it that the band grows from, outside and inside.
  std::array<std::array<BlockMask, 2>, kMaxRounds> source;
  /// Of the last `source`: those from which it also grows along two axes at once, and those from which it grows along
  /// one and stays a band.
  BlockMask oblique, straight;
  BlockMask active;    ///< voxels in the band
  BlockMask negative;  ///< known voxels inside
  /// Voxels that the planes around disagree on.
  BlockMask contested;
  /// Corners that extraction gives a value from their trusted neighbours.
  BlockMask repaired;
  std::array<Plane, 512> plane;  ///< written before they are read, where the masks say so
  std::vector<float> extra;      ///< 512 for each of BandSettings::channels

  [[nodiscard]] float distance(std::size_t at) const { return plane[at][3]; }
  /// Takes over what was gathered of a layer, its planes written.
  void know(int layer, const LayerMasks& of) {
    const auto z = static_cast<std::size_t>(layer);
    known[of.round].words[z] |= of.known;
    active.words[z] |= of.active;
    negative.words[z] |= of.negative;
    if (!of.grows) return;
    source[of.round][0].words[z] |= of.source & ~of.negative;
    source[of.round][1].words[z] |= of.source & of.negative;
    oblique.words[z] |= of.oblique;
    straight.words[z] |= of.straight;
  }
};

/// The bricks of a band that moves along z.
class BrickMap {
 public:
  /// `rounds`: that the band grows by; `channels`: beside distance and normal.
  BrickMap(int rounds, std::size_t channels);
  ~BrickMap();
  BrickMap(BrickMap&& other) noexcept;
  BrickMap& operator=(BrickMap&& other) = delete;

  [[nodiscard]] bool empty() const { return layers_.empty(); }
  /// The block z of the lowest bricks.
  [[nodiscard]] std::int32_t lowest() const { return layers_.begin()->first; }
  /// Makes it, all its masks empty, when there is none.
  Brick& touch(const Block& b);
  template <class Visit>
  void for_each(std::int32_t block_z, const Visit& visit) {
    const auto layer = layers_.find(block_z);
    if (layer == layers_.end()) return;
    for (Brick* const brick : layer->second.bricks) visit(*brick);
  }
  /// Takes the lowest layer out, in canonical order: by squares of 16 bricks and inside them by y, x.
  std::vector<Brick*> take_lowest();
  /// Bricks taken out, to be used again: fresh memory costs more than growing the band in it.
  void give_back(const std::vector<Brick*>& bricks);
  /// When none is in use.
  void free_spare();

 private:
  /// Bricks of one z in order of arrival, and a table of them by y, x with open addressing.
  struct Layer {
    std::vector<Brick*> bricks;
    std::vector<Brick*> slots = std::vector<Brick*>(64, nullptr);  ///< a power of two, half of it empty

    /// The place of the brick, or the empty one where it would be.
    std::size_t slot_of(std::int32_t y, std::int32_t x) const;
    [[nodiscard]] Brick* find(std::int32_t y, std::int32_t x) const { return slots[slot_of(y, x)]; }
    void add(Brick& brick);
  };

  int rounds_;
  std::size_t channels_;
  std::map<std::int32_t, Layer> layers_;  ///< by block z
  /// Bricks lie side by side in large pages: looking at twenty-seven at a time would miss the processor's table of
  /// pages at every step.
  class Slab;
  std::vector<std::unique_ptr<Slab>> slabs_;
  std::vector<Brick*> spare_;
};

}  // namespace lamina::volume

// A piece of the band, and where its neighbours are.
#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "window/corner_block.h"
#include "window/window.h"

namespace lamina::volume {

inline constexpr int kMaxRounds = 8;

/// What a voxel knows of the surface: its unit normal along the frame's axes, and the distance in voxels. Together, as
/// whoever reads one wants the other.
typedef float Plane __attribute__((vector_size(16)));  // NOLINT(modernize-use-using): attributes on typedefs

/// The band grows by steps that lead away from the surface by so much at least (Reach), voxels; those along two axes or
/// three at once by more.
inline constexpr float kShortestStep = 0.5F, kShortestOblique = 1.118F;

struct Growth {
  float band = 3;  ///< half width, voxels
  int rounds = 2;
};

/// 8^3 voxels.
struct Brick {
  Block block;
  /// The bricks around, x fastest, itself in the middle; null where there is none.
  std::array<Brick*, 27> around;
  /// By round: the projected voxels first; last also voxels beyond the band of which no more is known than the side.
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
  /// A voxel got its plane in a round.
  void know(int round, int at, const Plane& of, const Growth& growth) {
    const float distance = of[3], room = growth.band - std::abs(distance);
    known[static_cast<std::size_t>(round)].set(at);
    if (room > 0) active.set(at);
    if (distance < 0) negative.set(at);
    if (round == growth.rounds || !(room > kShortestStep)) return;
    source[static_cast<std::size_t>(round)][distance < 0 ? 1 : 0].set(at);
    if (round + 1 < growth.rounds) return;
    if (room > kShortestOblique) oblique.set(at);
    for (int axis = 0; axis < 3; ++axis) {
      const float up = std::abs(of[axis]);
      if (up >= kShortestStep && up < room) straight.set(at);
    }
  }
};

/// The bricks of a band that moves along z.
class BrickMap {
 public:
  /// `rounds`: that the band grows by; `channels`: beside distance and normal.
  BrickMap(int rounds, std::size_t channels) : rounds_(rounds), channels_(channels) {}

  [[nodiscard]] bool empty() const { return layers_.empty(); }
  /// The block z of the lowest bricks.
  [[nodiscard]] std::int32_t lowest() const { return layers_.begin()->first; }
  /// Makes it, all its masks empty, when there is none.
  Brick& touch(const Block& b);
  template <class Visit>
  void for_each(std::int32_t block_z, const Visit& visit) {
    const auto layer = layers_.find(block_z);
    if (layer == layers_.end()) return;
    for (const auto& brick : layer->second.bricks) visit(*brick);
  }
  /// Takes the lowest layer out, in canonical order (y, x).
  std::vector<std::unique_ptr<Brick>> take_lowest();
  /// Bricks taken out, to be used again: fresh memory costs more than growing the band in it.
  void give_back(std::vector<std::unique_ptr<Brick>> bricks);
  void free_spare() { spare_ = std::vector<std::unique_ptr<Brick>>(); }

 private:
  /// Bricks of one z in order of arrival, and a table of them by y, x with open addressing.
  struct Layer {
    std::vector<std::unique_ptr<Brick>> bricks;
    std::vector<Brick*> slots = std::vector<Brick*>(64, nullptr);  ///< a power of two, half of it empty

    /// The place of the brick, or the empty one where it would be.
    std::size_t slot_of(std::int32_t y, std::int32_t x) const;
    [[nodiscard]] Brick* find(std::int32_t y, std::int32_t x) const { return slots[slot_of(y, x)]; }
    void add(std::unique_ptr<Brick> brick);
  };

  int rounds_;
  std::size_t channels_;
  std::map<std::int32_t, Layer> layers_;  ///< by block z
  std::vector<std::unique_ptr<Brick>> spare_;
};

}  // namespace lamina::volume

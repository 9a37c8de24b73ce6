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
  /// By round: the voxels new in it that the band grows from.
  std::array<BlockMask, kMaxRounds + 1> source;
  /// Voxels of `source` from which the band also grows along two axes at once.
  BlockMask oblique;
  BlockMask active;  ///< voxels in the band
  /// Known voxels inside: from before the last round, and those of the last.
  BlockMask negative, last_negative;
  /// Voxels that the planes around disagree on.
  BlockMask contested;
  /// Corners that extraction gives a value from their trusted neighbours.
  BlockMask repaired;
  std::array<Plane, 512> plane;  ///< written before they are read, where the masks say so
  std::vector<float> extra;      ///< 512 for each of BandSettings::channels

  [[nodiscard]] float distance(std::size_t at) const { return plane[at][3]; }
  /// A voxel got its plane in a round.
  void know(int round, int at, float distance, const Growth& growth) {
    const float room = growth.band - std::abs(distance);
    known[static_cast<std::size_t>(round)].set(at);
    if (room > 0) active.set(at);
    if (round == growth.rounds) {  // the bricks around are looking at the masks of what they grow from
      if (distance < 0) last_negative.set(at);
      return;
    }
    if (distance < 0) negative.set(at);
    if (room > kShortestStep) source[static_cast<std::size_t>(round)].set(at);
    if (room > kShortestOblique) oblique.set(at);
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

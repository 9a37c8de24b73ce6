// A piece of the band, and where its neighbours are.
#pragma once
#include <array>
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

/// 8^3 voxels.
struct Brick {
  Block block;
  /// The bricks around, x fastest, itself in the middle; null where there is none.
  std::array<Brick*, 27> around;
  /// By round: the projected voxels first, the whole band last.
  std::array<BlockMask, kMaxRounds + 1> known;
  /// By round: the voxels new in it that the band grows from.
  std::array<BlockMask, kMaxRounds + 1> source;
  /// Voxels that the planes around disagree on.
  BlockMask contested;
  /// Corners that extraction gives a value from their trusted neighbours.
  BlockMask repaired;
  std::array<Plane, 512> plane;  ///< written before they are read, where the masks say so
  std::vector<float> extra;      ///< 512 for each of BandSettings::channels

  [[nodiscard]] float distance(std::size_t at) const { return plane[at][3]; }
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

// The narrow band around the surface at one lattice level: corners' own values, coarser and finer levels resampled, and
// what their planes say about the voxels around.
#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <unordered_map>
#include <vector>

#include "window/window.h"

namespace lamina::volume {

inline constexpr int kMaxRounds = 8;

struct BandSettings {
  int level = 0;              ///< voxels are the corners of this level
  bool other_levels = true;   ///< take the values of other levels where this one has none
  double band = 3;            ///< half width, voxels: farther values are left out
  int rounds = 2;             ///< voxels by which the band grows along the normals beyond what was projected
  std::vector<int> channels;  ///< of the window (corner_block.h), beside distance and normal
};

/// 8^3 voxels. Distances in voxels.
struct Brick {
  Block block;
  /// By round: the projected voxels first, the whole band last.
  std::array<BlockMask, kMaxRounds + 1> known;
  /// By round: the voxels new in it that the band grows from.
  std::array<BlockMask, kMaxRounds> source;
  /// Voxels that the planes around disagree on.
  BlockMask contested;
  /// Corners that extraction gives a value from their trusted neighbours.
  BlockMask repaired;
  std::array<float, 512> distance;
  std::array<std::array<std::int16_t, 512>, 3> normal;  ///< frame's axes, times kUnit
  std::vector<float> extra;                             ///< 512 for each of BandSettings::channels

  static constexpr float kUnit = 32767;
  [[nodiscard]] float normal_at(int axis, int offset) const {
    return static_cast<float>(normal[static_cast<std::size_t>(axis)][static_cast<std::size_t>(offset)]) / kUnit;
  }
};

/// A component of a unit vector, as bricks hold it.
inline std::int16_t packed_normal(float times_unit) {
  return static_cast<std::int16_t>(static_cast<std::int32_t>(times_unit + (times_unit < 0 ? -0.5F : 0.5F)));
}

class Band {
 public:
  Band(BandSettings settings, const Lattice& lattice);
  /// Takes the slab's corners, slab after slab. The slabs below and above must be finished, their values still there.
  void collect(const Window& window, std::int32_t slab);
  /// Bricks in which nothing changes any more, in canonical order (z, y, x); with `end`, all that are left.
  std::vector<std::unique_ptr<Brick>> pop(bool end);
  [[nodiscard]] const BandSettings& settings() const { return settings_; }
  /// The mask of the whole band.
  [[nodiscard]] const BlockMask& all(const Brick& brick) const { return brick.known[settings_.rounds]; }

 private:
  using Layer = std::unordered_map<std::uint64_t, std::unique_ptr<Brick>>;  // by y, x
  static std::uint64_t key_of(const Block& b);
  struct Found;
  Brick* find(const Block& b) const;
  Brick& touch(const Block& b);
  void collect_level(const Window& window, std::int32_t slab);
  void collect_finer(const Window& window, std::int32_t slab, int level);
  void collect_coarser(const Window& window, std::int32_t slab, int level);
  void put(const Found& found);
  void make_room(std::int32_t begin, std::int32_t end);
  void grow(int round, std::int32_t begin, std::int32_t end);
  void advance(bool end);

  BandSettings settings_;
  Lattice lattice_;
  float farthest_;  ///< a step along the normal, half a voxel at least, leads out of the band from here
  std::map<std::int32_t, Layer> layers_;             ///< by block z
  std::int32_t known_end_ = 0;                       ///< planes below are collected
  std::array<std::int32_t, kMaxRounds + 1> done_{};  ///< planes below have had the round
  bool begun_ = false;
};

}  // namespace lamina::volume

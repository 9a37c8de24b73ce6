// The narrow band around the surface at one lattice level: corners' own values, coarser and finer levels resampled, and
// what their planes say about the voxels around.
#pragma once
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "levelset/brick.h"
#include "octree/window.h"

namespace lamina::volume {

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

}  // namespace lamina::volume

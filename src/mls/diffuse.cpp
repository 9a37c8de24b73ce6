#include "mls/project.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <vector>

#include "mls/overhang.h"
#include "mls/tile_values.h"
#include "octree/window.h"

namespace lamina {
namespace {

struct Leaf {
  int level = -1;  ///< -1: none
  Cell cell;
  bool operator==(const Leaf&) const = default;
};

/// The leaf cell that fills an octant (bit 0: x, 1: y, 2: z; set = above) around a corner of `level`, whatever its
/// level.
Leaf leaf_in_octant(BlockCache& cache, int level, const Cell& corner, int octant) {
  const Cell toward{(octant & 1) - 1, ((octant >> 1) & 1) - 1, (octant >> 2) - 1};
  Cell cell = corner + toward;
  Cell at = corner;
  const CornerBlock* block = cache.block(level, cell);
  if (block != nullptr && block->split.test(offset_in_block(cell))) {
    // Down to the child that touches the corner, until one is not split.
    while (block != nullptr && block->split.test(offset_in_block(cell))) {
      at = {at.x * 2, at.y * 2, at.z * 2};
      cell = at + toward;
      block = cache.block(--level, cell);
    }
    if (block == nullptr || !block->cells.test(offset_in_block(cell))) return {};
    return {level, cell};
  }
  for (; level < cache.window().levels(); ++level) {
    block = cache.block(level, cell);
    if (block != nullptr && block->cells.test(offset_in_block(cell))) return {level, cell};
    if (block != nullptr && block->split.test(offset_in_block(cell))) return {};
    cell = {cell.x >> 1, cell.y >> 1, cell.z >> 1};
  }
  return {};
}

/// Means of the values of the centres around corners, one after the other; one thread's.
class CentresMean {
 public:
  enum class Found { nothing, seen, trusted };

  explicit CentresMean(const Window& window) : window_(window), cache_(window) {}

  /// Writes the record of a corner: the mean of the trusted centres, or of all where none is trusted.
  Found write(int level, const Cell& corner, float* record) {
    const bool trusted = list_centres(level, corner);
    const auto at = window_.lattice().position(level, corner);
    sum_ = {};
    attributes_.assign(static_cast<std::size_t>(window_.attributes()), 0.0F);
    for (int k = 0; k < count_; ++k) {
      if (!trusted || centres_[k]->trusted.test(offset_in_block(leaves_[k].cell))) add(leaves_[k], *centres_[k], at);
    }
    const std::array<float, 3>& n = sum_.normal;
    const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    if (sum_.weight <= 0 || !(length > kCancelledShare * sum_.weight)) return Found::nothing;
    const float inv = 1.0F / sum_.weight;
    record[kDistance] = sum_.distance * inv;
    for (int k = 0; k < 3; ++k) record[kNormalX + k] = n[k] / length;
    record[kCurvature] = sum_.curvature * inv;
    record[kOffsetFromMean] = sum_.offset_from_mean * inv;
    for (float& l : sum_.lean) l *= inv;
    if (window_.has_rare()) {
      record[kLean] = packed_lean(sum_.lean);
      record[kDensity] = sum_.density * inv;
    }
    float* const attributes = record + window_.first_attribute();
    for (std::size_t c = 0; c < attributes_.size(); ++c) attributes[c] = attributes_[c] * inv;
    return trusted ? Found::trusted : Found::seen;
  }
  [[nodiscard]] bool is_outside() const { return sum_.distance >= 0; }  ///< the last corner

 private:
  /// Normals whose mean is shorter than this cancel.
  static constexpr float kCancelledShare = 1e-6F;

  struct Sum {
    float weight = 0;
    float distance = 0, curvature = 0, offset_from_mean = 0, density = 0;
    std::array<float, 3> normal{}, lean{};
  };

  /// The seen centres of the leaf cells around a corner, each once; true where one of them is trusted.
  bool list_centres(int level, const Cell& corner) {
    count_ = 0;
    bool trusted = false;
    for (int octant = 0; octant < 8; ++octant) {
      const Leaf l = leaf_in_octant(cache_, level, corner, octant);
      const auto end = leaves_.begin() + count_;
      if (l.level < 0 || std::find(leaves_.begin(), end, l) != end) continue;
      const CornerBlock* const block = cache_.block(l.level, l.cell);
      const int offset = offset_in_block(l.cell);
      if (block->centres == nullptr || !block->centres->seen.test(offset)) continue;
      trusted = trusted || block->centres->trusted.test(offset);
      centres_[count_] = block->centres.get();
      leaves_[count_++] = l;
    }
    return trusted;
  }

  /// Adds a centre's surface as it is seen from the corner: the second-order distance of the osculating sphere.
  void add(const Leaf& leaf, const Projected& from, const std::array<std::int32_t, 3>& corner_at) {
    const int offset = offset_in_block(leaf.cell);
    const CornerValues& values = from.values[window_.slab_in_leaf(leaf.level, offset >> 6)];
    const float* const v = values.of(from.value_index(offset, window_.slab_layers(leaf.level)));
    const auto cell = static_cast<float>(window_.lattice().cell_size(leaf.level));
    const auto cell_at = window_.lattice().position(leaf.level, leaf.cell);
    std::array<float, 3> o{};
    for (int k = 0; k < 3; ++k) o[k] = static_cast<float>(corner_at[k] - cell_at[k]) - 0.5F * cell;
    const std::array<float, 3> n{v[kNormalX], v[kNormalY], v[kNormalZ]};
    const float along = n[0] * o[0] + n[1] * o[1] + n[2] * o[2];
    const float across = o[0] * o[0] + o[1] * o[1] + o[2] * o[2] - along * along;
    const float w = 1.0F / cell;
    sum_.weight += w;
    sum_.distance += w * (v[kDistance] + along + 0.5F * v[kCurvature] * across);
    sum_.curvature += w * v[kCurvature];
    sum_.offset_from_mean += w * v[kOffsetFromMean];
    if (window_.has_rare()) {
      sum_.density += w * v[kDensity];
      const std::array<float, 3> lean = unpacked_lean(v[kLean]);
      for (int k = 0; k < 3; ++k) sum_.lean[k] += w * lean[k];
    }
    for (int k = 0; k < 3; ++k) sum_.normal[k] += w * n[k];
    const float* const attributes = v + window_.first_attribute();
    for (std::size_t c = 0; c < attributes_.size(); ++c) attributes_[c] += w * attributes[c];
  }

  const Window& window_;
  BlockCache cache_;
  std::array<Leaf, 8> leaves_{};
  std::array<const Projected*, 8> centres_{};
  int count_ = 0;
  Sum sum_;
  std::vector<float> attributes_;
};

}  // namespace

void diffuse_slab(Window& window, std::int32_t slab) {
  for (int level = 0; level < window.levels(); ++level) {
    const Tiles tiles = window.tiles(level, slab);
    tbb::parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t i) {
      const Tile& t = tiles[i];
      const LeafLayers layers = leaf_layers(window, level, slab, t.block);
      const auto [begin, end] = layers;
      if (!allocate_values(window, level, *t.leaf, layers)) return;
      CornerValues& values = t.leaf->values[window.slab_in_leaf(level, begin)];
      CentresMean mean(window);
      std::uint32_t at = 0;
      for (int z = begin; z < end; ++z) {
        for (std::uint64_t w = t.leaf->active.words[z]; w != 0; w &= w - 1, ++at) {
          const int bit = std::countr_zero(w);
          if (((t.leaf->shared.words[z] >> bit) & 1U) != 0) continue;
          const Cell corner{t.block.x * 8 + (bit & 7), t.block.y * 8 + (bit >> 3), t.block.z * 8 + z};
          const CentresMean::Found found = mean.write(level, corner, values.of(at));
          if (found == CentresMean::Found::nothing) continue;
          const int offset = z * 64 + bit;
          t.leaf->seen.set(offset);
          t.leaf->outside.assign(offset, mean.is_outside());
          if (found == CentresMean::Found::trusted) t.leaf->trusted.set(offset);
        }
      }
      copy_shared(window, level, t, layers);
    });
  }
}

}  // namespace lamina

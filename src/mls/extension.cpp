#include "mls/extension.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <span>

#include "lattice/morphology.h"

namespace lamina {
namespace {

/// Bits of a layer's corners: their signs, and whether anything speaks for them.
struct Signs {
  std::uint64_t outside = 0, defined = 0, supported = 0;
};

TangentPlane<float> plane_of(const float* record) {
  return {record[kDistance], record[kNormalX], record[kNormalY], record[kNormalZ]};
}

/// One tile after the other; one thread's.
class TileExtender {
 public:
  TileExtender(const Window& window, const Kernel& kernel, float boundary, CornerField& scratch)
      : window_(window), kernel_(kernel), boundary_(boundary), field_(scratch) {}

  void extend(int level, const Tile& t, LeafLayers layers) {
    level_ = level;
    leaf_ = t.leaf;
    layers_ = layers;
    std::uint64_t any = 0;
    std::uint64_t doubtful = 0;
    for (int z = layers.begin; z < layers.end; ++z) any |= leaf_->corners.words[z], doubtful |= wanted(z);
    if (any == 0) return;
    found_count_ = 0;
    std::array<std::uint64_t, 8> beside{};  // corners beside trusted ones, not trusted themselves
    if (doubtful != 0) find_beside(beside);
    for (int z = layers.begin; z < layers.end; ++z) {
      const std::uint64_t corners = leaf_->corners.words[z];
      if (corners == 0) continue;
      const Signs signs = signs_of_layer(t, z, beside[z]);
      leaf_->outside.words[z] = signs.outside & corners;
      leaf_->defined.words[z] = signs.defined & corners;
      leaf_->supported.words[z] = signs.supported & corners;
    }
    for (const Found& f : found()) field_.take_out(f.x, f.y, f.z);
  }

 private:
  /// Corners of the layer that have no trusted value of their own.
  [[nodiscard]] std::uint64_t wanted(int z) const {
    return leaf_->corners.words[z] & ~leaf_->shared.words[z] & ~leaf_->trusted.words[z];
  }

  Signs signs_of_layer(const Tile& t, int z, std::uint64_t beside) const {
    const std::uint64_t shared = leaf_->shared.words[z];
    const std::uint64_t trusted = leaf_->trusted.words[z];
    const std::uint64_t own = leaf_->outside.words[z];  // as projection left them
    Signs signs;
    if (shared != 0) signs = finer_signs(t, z);
    signs.outside |= own & trusted & ~shared;
    signs.defined |= trusted & ~shared;
    signs.supported |= leaf_->seen.words[z] & ~shared;
    if (const std::uint64_t all = wanted(z); all != 0) {
      Signs extended;
      if (beside != 0) extended = extended_signs(z, beside);
      // Nobody to extend from.
      const std::uint64_t lone = all & ~extended.defined;
      std::uint64_t alone = lone & leaf_->seen.words[z];
      if (alone != 0) alone &= ~beyond(z, kOwnOffset);
      signs.outside |= (extended.outside & extended.defined) | (lone & ~alone) | (own & alone);
      signs.defined |= extended.defined | alone;
      signs.supported |= extended.supported;
    }
    if (boundary_ > 0) signs.defined &= ~(beyond(z, boundary_) & ~shared);
    return signs;
  }

  /// Of the layer's corners that a finer level holds.
  [[nodiscard]] Signs finer_signs(const Tile& t, int z) const {
    Signs out;
    for (std::uint64_t w = leaf_->shared.words[z]; w != 0; w &= w - 1) {
      const FinerCorner from = finer_corner(window_, level_, t, z, std::countr_zero(w));
      const std::uint64_t one = w & (~w + 1);
      if (from.block->outside.test(from.offset)) out.outside |= one;
      if (from.block->defined.test(from.offset)) out.defined |= one;
      if (from.block->supported.test(from.offset)) out.supported |= one;
    }
    return out;
  }

  /// Of the layer's corners in `wanted`, by the planes of their trusted neighbours.
  [[nodiscard]] Signs extended_signs(int z, std::uint64_t wanted) const {
    const auto cell = static_cast<float>(window_.lattice().cell_size(level_));
    Signs out;
    for (int y = 0; y < 8; ++y) {
      if (((wanted >> (8 * y)) & 0xFFU) == 0) continue;
      const Extension e = kernel_.extend(field_, y, z, cell, kSurrounded * kSurrounded);
      out.outside |= std::uint64_t{e.outside} << (8 * y);
      out.defined |= std::uint64_t{e.defined} << (8 * y);
      out.supported |= std::uint64_t{e.surrounded} << (8 * y);
    }
    return {out.outside & wanted, out.defined & wanted, out.supported & wanted};
  }

  /// Corners of the layer whose own projected point lies beyond the limit.
  [[nodiscard]] std::uint64_t beyond(int z, float limit) const {
    if (leaf_->seen.words[z] == 0) return 0;
    std::uint64_t out = 0;
    const CornerValues& values = leaf_->values[window_.slab_in_leaf(level_, z)];
    std::uint32_t i = leaf_->value_index(z * 64, window_.slab_layers(level_));
    for (std::uint64_t w = leaf_->active.words[z]; w != 0; w &= w - 1, ++i) {
      if (values.channel(kOffsetFromMean)[i] > limit) out |= w & (~w + 1);
    }
    return out & leaf_->seen.words[z];
  }

  /// Finds the wanted corners beside trusted ones, and gathers what these say.
  void find_beside(std::array<std::uint64_t, 8>& beside) {
    bits::dilate_layers<-1, 1>(trusted_around(), layers_.begin, layers_.end, &beside[layers_.begin]);
    std::uint64_t any = 0;
    for (int z = layers_.begin; z < layers_.end; ++z) any |= beside[z] &= wanted(z);
    if (any != 0) gather_field(beside);
  }

  /// The trusted corners of the block and of its 26 neighbours.
  [[nodiscard]] bits::Neighbourhood trusted_around() const {
    bits::Neighbourhood n;  // NOLINT(cppcoreguidelines-pro-type-member-init): filled next
    for (std::size_t i = 0, z = 0; z < 3; ++z) {
      for (std::size_t y = 0; y < 3; ++y) {
        for (std::size_t x = 0; x < 3; ++x, ++i) {
          const CornerBlock* const block = leaf_->around[i];
          n[z][y][x] = block == nullptr ? nullptr : &block->trusted;
        }
      }
    }
    return n;
  }

  /// A trusted corner in reach of the tile, and where it lies from the tile's origin.
  struct Found {
    const float* record;
    std::int8_t x, y, z;
  };

  /// Of the trusted corners those beside corners in `beside`, layer by layer. Records lie anywhere in memory: all are
  /// asked for before the first is looked at.
  void gather_field(const std::array<std::uint64_t, 8>& beside) {
    const auto layer = [&](int z) { return z >= 0 && z < 8 ? beside[z] : 0; };
    for (int z = layers_.begin - 1; z <= layers_.end; ++z) {
      const std::uint64_t near = layer(z - 1) | layer(z) | layer(z + 1);
      if (near == 0) continue;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) find_records(dx, dy, z, beside_in(near, dx, dy));
      }
    }
    for (const Found& f : found()) field_.put(f.x, f.y, f.z, plane_of(f.record));
  }
  [[nodiscard]] std::span<const Found> found() const { return {found_.data(), found_count_}; }

  /// The corners beside those of a word, and those, as the block (dx, dy) blocks away has them in its word.
  static std::uint64_t beside_in(std::uint64_t w, int dx, int dy) {
    const auto when = [&](bool holds) { return holds ? w : 0; };
    w = bits::spread_y<-1, 1>(when(dy > 0), when(dy == 0), when(dy < 0));
    return bits::spread_x<-1, 1>(when(dx > 0), when(dx == 0), when(dx < 0));
  }

  /// Trusted ones among `wanted`, of layer z, in [-1, 8], of the block's neighbour at (dx, dy) across the sweep axis.
  void find_records(int dx, int dy, int z, std::uint64_t wanted) {
    const CornerBlock* const from = leaf_->around[CornerBlock::towards(dx, dy, z >> 3)];
    const int layer = z & 7;
    // One question for three: which of them has an answer is as good as random.
    std::uint64_t w = (from == nullptr ? bits::kNoBits : from->trusted).words[layer] & wanted;
    if (w == 0) return;
    const CornerValues& values = from->values[window_.slab_in_leaf(level_, layer)];
    if (values.count == 0) return;
    const std::uint32_t base = from->value_index(layer * 64, window_.slab_layers(level_));
    const std::uint64_t active = from->active.words[layer];
    for (; w != 0; w &= w - 1) {
      const int bit = std::countr_zero(w);
      const std::uint64_t before = active & ((std::uint64_t{1} << bit) - 1);
      const float* const record = values.of(base + static_cast<std::uint32_t>(std::popcount(before)));
      __builtin_prefetch(record);
      found_[found_count_++] = {record, static_cast<std::int8_t>(dx * 8 + (bit & 7)),
                                static_cast<std::int8_t>(dy * 8 + (bit >> 3)), static_cast<std::int8_t>(z)};
    }
  }

  const Window& window_;
  const Kernel& kernel_;
  float boundary_;
  CornerField& field_;
  int level_ = 0;
  CornerBlock* leaf_ = nullptr;
  LeafLayers layers_{0, 0};
  std::array<Found, 1000> found_;
  std::size_t found_count_ = 0;
};

/// A corner's place in its level.
struct Place {
  const CornerBlock* block;
  int offset;

  /// The record of its own value; null where it has none that is trusted.
  [[nodiscard]] const float* trusted_record(const Window& window, int level) const {
    return block != nullptr && block->trusted.test(offset) ? record(window, level) : nullptr;
  }
  /// The same of any seen corner.
  [[nodiscard]] const float* record(const Window& window, int level) const {
    const CornerValues& values = block->values[window.slab_in_leaf(level, offset >> 6)];
    return values.count == 0 ? nullptr : values.of(block->value_index(offset, window.slab_layers(level)));
  }
};

void read_record(const Window& window, const float* record, CornerValue& out, float* attributes) {
  out = {record[kDistance],
         {record[kNormalX], record[kNormalY], record[kNormalZ]},
         record[kCurvature],
         record[kOffsetFromMean]};
  for (int c = 0; attributes != nullptr && c < window.attributes(); ++c)
    attributes[c] = record[window.first_attribute() + c];
}

/// Normals whose weighted sum is shorter than this cancel.
constexpr float kCancelled = 1e-6F;

/// The weighted mean of the trusted neighbours' planes; false where there are none. What Kernel::extend() decides signs
/// by, neighbour by neighbour in the same order.
bool extended_value(const Window& window, int level, const Place& here, CornerValue& out, float* attributes) {
  const auto cell = static_cast<float>(window.lattice().cell_size(level));
  CornerValue sum;
  float total = 0;
  for (int c = 0; attributes != nullptr && c < window.attributes(); ++c) attributes[c] = 0;
  const int first = window.first_attribute();
  const auto add = [&](int dx, int dy, int dz, const float* v) {
    const float w = neighbour_weight(dx, dy, dz);
    sum.distance += w * plane_of(v).seen_from(dx, dy, dz, cell);
    for (int k = 0; k < 3; ++k) sum.normal[k] += w * v[kNormalX + k];
    sum.curvature += w * v[kCurvature];
    for (int c = 0; attributes != nullptr && c < window.attributes(); ++c) attributes[c] += w * v[first + c];
    total += w;
  };
  for_records_around(*here.block, here.offset, &Projected::trusted, window.slab_layers(level), add);
  if (total <= 0) return false;
  const float inv = 1.0F / total;
  const float length =
      std::sqrt(sum.normal[0] * sum.normal[0] + sum.normal[1] * sum.normal[1] + sum.normal[2] * sum.normal[2]);
  out.distance = sum.distance * inv;
  for (int k = 0; k < 3; ++k) out.normal[k] = length > kCancelled ? sum.normal[k] / length : 0.0F;
  out.curvature = sum.curvature * inv;
  out.offset_from_mean = 0;
  for (int c = 0; attributes != nullptr && c < window.attributes(); ++c) attributes[c] *= inv;
  return true;
}

}  // namespace

void extend_slab(Window& window, std::int32_t slab, const Kernel& kernel, float boundary) {
  using Parts = BlockParts<&CornerBlock::around, &CornerBlock::trusted, &CornerBlock::seen, &CornerBlock::active,
                           &CornerBlock::values, &CornerBlock::corners, &CornerBlock::shared, &CornerBlock::outside,
                           &CornerBlock::defined, &CornerBlock::supported>;
  tbb::enumerable_thread_specific<CornerField> fields;
  for (int level = 0; level < window.levels(); ++level) {
    const Tiles tiles = window.tiles(level, slab);
    tbb::parallel_for(
        std::size_t{0}, tiles.size(),
        [&](std::size_t i) {
          ask_ahead<Parts>(tiles, i);
          TileExtender extender(window, kernel, boundary, fields.local());
          extender.extend(level, tiles[i], leaf_layers(window, level, slab, tiles[i].block));
        },
        window.affinity());
  }
}

bool corner_value(const Window& window, int level, const Cell& corner, CornerValue& out, float* attributes) {
  const Place here{window.probe(level, block_of(corner)), offset_in_block(corner)};
  if (here.block->shared.test(here.offset)) {
    const FinerCorner finer = finer_corner(window, level, corner);
    return corner_value(window, finer.level, finer.corner, out, attributes);
  }
  if (const float* const own = here.trusted_record(window, level)) {
    read_record(window, own, out, attributes);
    return true;
  }
  if (extended_value(window, level, here, out, attributes)) return true;
  if (!here.block->defined.test(here.offset) || !here.block->seen.test(here.offset)) return false;
  read_record(window, here.record(window, level), out, attributes);
  return true;
}

}  // namespace lamina

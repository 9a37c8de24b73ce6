#include "levelset/band.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "lattice/morphology.h"
#include "mls/extension.h"
#include "octree/window.h"

namespace lamina::volume {
namespace {

constexpr float kBeyond = 1;  ///< voxels outside of the band that tell the side of its neighbours

/// What a corner's value says in a channel of the window; attributes lie behind.
float channel_of(const CornerValue& v, const std::vector<float>& attributes, int channel) {
  if (channel == kOffsetFromMean) return v.offset_from_mean;
  if (channel == kCurvature) return v.curvature;
  return attributes[static_cast<std::size_t>(channel - kFirstAttribute)];
}

}  // namespace

/// Values from another level, those of the channels one voxel after the other.
struct Band::Found {
  struct Voxel {
    Cell at;
    float distance = 0;
    std::array<float, 3> normal{};
  };
  std::vector<Voxel> voxels;
  std::vector<float> extra;
};

Band::Band(BandSettings settings, const Lattice& lattice)
    : settings_(std::move(settings)),
      lattice_(lattice),
      bricks_(std::clamp(settings_.rounds, 0, kMaxRounds), settings_.channels.size()) {
  settings_.rounds = std::clamp(settings_.rounds, 0, kMaxRounds);
}

void Band::collect(const Window& window, std::int32_t slab) {
  const std::int32_t begin = lattice_.first_layer(settings_.level, slab);
  const std::int32_t end = begin + lattice_.layers(settings_.level);
  if (!begun_) {
    begun_ = true;
    done_.fill(begin - settings_.rounds - 1);
  }
  collect_level(window, slab);
  if (settings_.other_levels) {
    for (int level = settings_.level - 1; level >= 0; --level) collect_finer(window, slab, level);
    for (int level = settings_.level + 1; level < lattice_.levels; ++level) collect_coarser(window, slab, level);
  }
  make_room(begin, end);
  known_end_ = end;
}

/// Corners of the level itself: trusted, and not rejected by --boundary.
void Band::collect_level(const Window& window, std::int32_t slab) {
  const int level = settings_.level;
  const std::int32_t first = lattice_.first_layer(level, slab);
  struct Job {
    const CornerBlock* leaf;
    Brick* brick;
    int begin, end;
  };
  std::vector<Job> jobs;
  for (const Tile& t : window.tiles(level, slab)) {
    const int begin = std::max(0, first - t.block.z * 8), end = std::min(8, begin + lattice_.layers(level));
    std::uint64_t any = 0;
    for (int z = begin; z < end; ++z) any |= t.leaf->defined.words[z];
    if (any != 0) jobs.push_back({t.leaf, &bricks_.touch(t.block), begin, end});
  }
  const float per_voxel = 1.0F / static_cast<float>(lattice_.cell_size(level));
  const Growth growth = growth_of(settings_);
  tbb::parallel_for(std::size_t{0}, jobs.size(), [&](std::size_t j) {
    const auto [leaf, brick, begin, end] = jobs[j];
    for (int z = begin; z < end; ++z) {
      brick->repaired.words[z] = leaf->defined.words[z] & ~leaf->trusted.words[z];
      const CornerValues& values = leaf->values[window.slab_in_leaf(level, z)];
      if (values.count == 0) continue;
      const std::uint32_t base = leaf->value_index(z * 64, window.slab_layers(level));
      const std::uint64_t active = leaf->active.words[z];
      LayerMasks masks(0, growth);
      for (std::uint64_t w = leaf->trusted.words[z] & leaf->defined.words[z]; w != 0; w &= w - 1) {
        const int bit = std::countr_zero(w), at = z * 64 + bit;
        const std::uint32_t i =
            base + static_cast<std::uint32_t>(std::popcount(active & ((std::uint64_t{1} << bit) - 1)));
        const Plane plane{values.channel(kNormalX)[i], values.channel(kNormalX + 1)[i], values.channel(kNormalX + 2)[i],
                          values.channel(kDistance)[i] * per_voxel};
        brick->plane[at] = plane;
        masks.add(bit, plane);
        for (std::size_t c = 0; c < settings_.channels.size(); ++c)
          brick->extra[c * 512 + at] = values.channel(window.place_of(settings_.channels[c]))[i];
      }
      brick->know(z, masks);
    }
  });
}

void Band::put(const Found& found) {
  const std::size_t channels = settings_.channels.size();
  for (std::size_t i = 0; i < found.voxels.size(); ++i) {
    const Found::Voxel& f = found.voxels[i];
    Brick& brick = bricks_.touch(block_of(f.at));
    const int at = offset_in_block(f.at);
    if (brick.known[0].test(at)) continue;
    brick.plane[at] = Plane{f.normal[0], f.normal[1], f.normal[2], f.distance};
    LayerMasks masks(0, growth_of(settings_));
    masks.add(at & 63, brick.plane[at]);
    brick.know(at >> 6, masks);
    for (std::size_t c = 0; c < channels; ++c) brick.extra[c * 512 + at] = found.extra[i * channels + c];
  }
}

/// Where cells are finer, some of their corners are voxels.
void Band::collect_finer(const Window& window, std::int32_t slab, int level) {
  const int shift = settings_.level - level;
  const std::int32_t mask = (1 << shift) - 1;
  const auto tiles = window.tiles(level, slab);
  std::vector<Found> found(tiles.size());
  const float per_voxel = 1.0F / static_cast<float>(lattice_.cell_size(settings_.level));
  const auto limit = static_cast<float>(settings_.band) + kBeyond;
  tbb::parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t i) {
    const Tile& t = tiles[i];
    const std::int32_t first = lattice_.first_layer(level, slab) - t.block.z * 8;
    std::vector<float> attributes(static_cast<std::size_t>(window.attributes()));
    for (int z = std::max(first, 0); z < std::min(8, first + lattice_.layers(level)); ++z) {
      if (((t.block.z * 8 + z) & mask) != 0) continue;
      for (std::uint64_t w = t.leaf->defined.words[z]; w != 0; w &= w - 1) {
        const int bit = std::countr_zero(w);
        const Cell corner{t.block.x * 8 + (bit & 7), t.block.y * 8 + (bit >> 3), t.block.z * 8 + z};
        if (((corner.x | corner.y) & mask) != 0) continue;
        CornerValue v;
        if (!corner_value(window, level, corner, v, attributes.data()) || !v.has_normal()) continue;
        const float distance = v.distance * per_voxel;
        if (!(std::abs(distance) < limit)) continue;
        found[i].voxels.push_back({{corner.x >> shift, corner.y >> shift, corner.z >> shift}, distance, v.normal});
        for (const int c : settings_.channels) found[i].extra.push_back(channel_of(v, attributes, c));
      }
    }
  });
  for (const Found& f : found) put(f);
}

/// A cell of a coarser level, and what its corners say about the voxels inside.
class Band::CoarseCell {
 public:
  CoarseCell(const Band& band, const Window& window, int level)
      : settings_(band.settings_),
        window_(window),
        level_(level),
        shift_(level - settings_.level),
        per_voxel_(1.0F / static_cast<float>(band.lattice_.cell_size(settings_.level))),
        limit_(static_cast<float>(settings_.band) + kBeyond),
        cache_(window),
        attributes_(static_cast<std::size_t>(window.attributes())),
        extra_(8 * settings_.channels.size()) {}

  /// Adds the voxels of the cell that lie in the band, or next to it.
  void interpolate(const Cell& cell, Found& out) {
    if (!read_corners(cell)) return;
    const int side = 1 << shift_;
    for (int v = 0; v < side * side * side; ++v)
      add_voxel(cell, {v & (side - 1), v >> shift_ & (side - 1), v >> (2 * shift_)}, out);
  }

 private:
  /// Whether the surface crosses the cell, or lies near enough for its voxels to be in the band.
  bool read_corners(const Cell& cell) {
    // The surface crosses a cell only between defined corners; far from it none is trusted.
    int trusted = 0;
    for (int k = 0; k < 8; ++k)
      trusted += cache_.test(level_, cell + Cell{k & 1, k >> 1 & 1, k >> 2}, &CornerBlock::trusted);
    if (trusted == 0) return false;
    has_ = {};
    defined_ = 0;
    const float farthest = limit_ + 1.75F * static_cast<float>(1 << shift_);  // no voxel of the cell lies in the band
    float nearest = farthest;
    const std::size_t channels = settings_.channels.size();
    for (std::size_t k = 0; k < 8; ++k) {
      const auto corner = static_cast<int>(k);
      has_[k] = corner_value(window_, level_, cell + Cell{corner & 1, corner >> 1 & 1, corner >> 2}, corners_[k],
                             attributes_.data()) &&
                corners_[k].has_normal();
      if (!has_[k]) continue;
      nearest = std::min(nearest, std::abs(corners_[k].distance) * per_voxel_);
      if (nearest >= farthest) return false;
      ++defined_;
      for (std::size_t c = 0; c < channels; ++c)
        extra_[k * channels + c] = channel_of(corners_[k], attributes_, settings_.channels[c]);
    }
    return defined_ >= 4;
  }

  void add_voxel(const Cell& cell, const std::array<int, 3>& in, Found& out) const {
    const auto side = static_cast<float>(1 << shift_);
    const std::size_t channels = settings_.channels.size(), first = out.extra.size();
    Found::Voxel f{{(cell.x << shift_) + in[0], (cell.y << shift_) + in[1], (cell.z << shift_) + in[2]}};
    out.extra.resize(first + channels, 0);
    float* const extra = out.extra.data() + first;
    float total = 0, values = 0, planes = 0;
    for (std::size_t k = 0; k < 8; ++k) {
      if (!has_[k]) continue;
      const CornerValue& corner = corners_[k];
      float weight = 1, plane = corner.distance * per_voxel_;
      for (std::size_t a = 0; a < 3; ++a) {
        const auto x = static_cast<float>(in[a]);
        const float at_corner = (k >> a & 1) != 0 ? side : 0.0F;
        weight *= 1 - std::abs(x - at_corner) / side;
        plane += corner.normal[a] * (x - at_corner);
      }
      total += weight;
      values += weight * corner.distance * per_voxel_;
      planes += weight * plane;
      for (std::size_t a = 0; a < 3; ++a) f.normal[a] += weight * corner.normal[a];
      for (std::size_t c = 0; c < channels; ++c) extra[c] += weight * extra_[k * channels + c];
    }
    // Values between corners lie outside of a curved surface's distance by as much as the corners' planes lie
    // inside; corners without a value have no say in either, which only the planes can bear.
    f.distance = (defined_ == 8 ? 0.5F * (values + planes) : planes) / total;
    const float length = std::hypot(f.normal[0], f.normal[1], f.normal[2]);
    if (!(total > 0) || !(length > 1e-3F) || !(std::abs(f.distance) < limit_)) {
      out.extra.resize(first);
      return;
    }
    for (std::size_t c = 0; c < channels; ++c) extra[c] /= total;
    for (float& n : f.normal) n /= length;
    out.voxels.push_back(f);
  }

  const BandSettings& settings_;
  const Window& window_;
  int level_, shift_;
  float per_voxel_, limit_;  ///< voxels per step; distances beyond are of no use
  BlockCache cache_;
  std::vector<float> attributes_;
  std::array<bool, 8> has_{};  ///< a value
  int defined_ = 0;            ///< how many have
  std::array<CornerValue, 8> corners_;
  std::vector<float> extra_;  ///< the channels of corner after corner
};

/// Where cells are coarser, voxels inside them are interpolated between their corners.
void Band::collect_coarser(const Window& window, std::int32_t slab, int level) {
  const auto tiles = window.tiles(level, slab);
  std::vector<Found> found(tiles.size());
  tbb::parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t i) {
    const Tile& t = tiles[i];
    const std::int32_t first = lattice_.first_layer(level, slab) - t.block.z * 8;
    CoarseCell coarse(*this, window, level);
    for (int z = std::max(first, 0); z < std::min(8, first + lattice_.layers(level)); ++z) {
      for (std::uint64_t w = t.leaf->cells.words[z]; w != 0; w &= w - 1) {
        const int bit = std::countr_zero(w);
        coarse.interpolate({t.block.x * 8 + (bit & 7), t.block.y * 8 + (bit >> 3), t.block.z * 8 + z}, found[i]);
      }
    }
  });
  for (const Found& f : found) put(f);
}

/// Bricks for what grows out of those that have voxels in the planes.
void Band::make_room(std::int32_t begin, std::int32_t end) {
  const int r = settings_.rounds;
  if (r == 0) return;
  const std::uint64_t low_x = bits::columns_below(r), high_x = ~bits::columns_below(8 - r);
  const std::uint64_t low_y = bits::rows_below(r), high_y = ~bits::rows_below(8 - r);
  std::vector<Block> wanted;
  for (std::int32_t bz = begin >> 3; bz <= (end - 1) >> 3; ++bz) {
    bricks_.for_each(bz, [&](const Brick& brick) {
      std::array<std::uint64_t, 3> planes{};  // near the lower end, all, near the upper end
      for (int z = std::max(0, begin - bz * 8); z < std::min(8, end - bz * 8); ++z) {
        const std::uint64_t w = brick.known[0].words[z];
        if (z < r) planes[0] |= w;
        if (z >= 8 - r) planes[2] |= w;
        planes[1] |= w;
      }
      for (int i = 0; i < 27; ++i) {
        if (brick.around[i] != nullptr) continue;
        const int dx = i % 3 - 1, dy = i / 3 % 3 - 1, dz = i / 9 - 1;
        std::uint64_t w = planes[dz + 1];
        if (dy != 0) w &= dy < 0 ? low_y : high_y;
        if (dx != 0) w &= dx < 0 ? low_x : high_x;
        if (w != 0) wanted.push_back({brick.block.x + dx, brick.block.y + dy, bz + dz});
      }
    });
  }
  for (const Block& b : wanted) bricks_.touch(b);
}

void Band::advance(bool end) {
  if (!begun_) return;
  done_[0] = end ? known_end_ + settings_.rounds + 1 : known_end_;
  for (int r = 1; r <= settings_.rounds; ++r) {
    const std::int32_t to = done_[0] - r;
    // Every round waits for the one before, and for whole bricks: each is then looked at once a round.
    const std::int32_t upper = end ? to : std::min(to, done_[r - 1] - (r > 1 ? 1 : 0)) & ~7;
    if (upper <= done_[r]) continue;
    grow(r, done_[r], upper);
    done_[r] = upper;
  }
}

std::vector<Brick*> Band::pop(bool end) {
  advance(end);
  std::vector<Brick*> out;
  // A layer's last plane is still read by the round of the plane above.
  const std::int32_t done = done_[settings_.rounds] - (settings_.rounds > 0 ? 1 : 0);
  while (!bricks_.empty() && begun_ && (end || bricks_.lowest() * 8 + 8 < done)) {
    std::vector<Brick*> layer = bricks_.take_lowest();
    const auto full = std::stable_partition(layer.begin(), layer.end(), [](const Brick* b) { return b->active.any(); });
    out.insert(out.end(), layer.begin(), full);
    layer.erase(layer.begin(), full);
    bricks_.give_back(layer);
  }
  return out;
}

}  // namespace lamina::volume

#include "levelset/brick.h"

#include <fmt/format.h>
#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <new>
#include <optional>
#include <utility>

#include "lamina/error.h"
#include "lamina/volume_export.h"
#include "lattice/morphology.h"
#include "levelset/band.h"
#include "vdb/vdb_file.h"

namespace lamina::volume {

class BrickMap::Slab {
 public:
  Slab() : memory_(static_cast<std::byte*>(std::aligned_alloc(kBytes, kBytes))) {
    if (memory_ == nullptr) throw std::bad_alloc();
    ::madvise(memory_.get(), kBytes, MADV_HUGEPAGE);  // where there are none, small ones do as well
    for (std::size_t i = 0; i < kBricks; ++i) ::new (memory_.get() + i * sizeof(Brick)) Brick;
  }
  ~Slab() { std::destroy_n(bricks(), kBricks); }
  Slab(const Slab&) = delete;
  Slab& operator=(const Slab&) = delete;
  /// The first at the end.
  void list(std::vector<Brick*>& to) {
    for (std::size_t i = kBricks; i-- > 0;) to.push_back(bricks() + i);
  }

 private:
  static constexpr std::size_t kBytes = std::size_t{1} << 21, kBricks = kBytes / sizeof(Brick);
  struct Free {
    void operator()(void* p) const { std::free(p); }
  };
  Brick* bricks() { return std::launder(reinterpret_cast<Brick*>(memory_.get())); }

  std::unique_ptr<std::byte, Free> memory_;
};

BrickMap::BrickMap(int rounds, std::size_t channels) : rounds_(rounds), channels_(channels) {}
BrickMap::~BrickMap() = default;
BrickMap::BrickMap(BrickMap&& other) noexcept = default;

std::size_t BrickMap::Layer::slot_of(std::int32_t y, std::int32_t x) const {
  // Neighbours along x lie side by side; rows are thrown far apart.
  constexpr std::uint32_t kFar = 0x9E3779B1;
  const std::size_t mask = slots.size() - 1;
  std::size_t at = (static_cast<std::uint32_t>(x) + static_cast<std::uint32_t>(y) * kFar) & mask;
  while (slots[at] != nullptr && (slots[at]->block.x != x || slots[at]->block.y != y)) at = (at + 1) & mask;
  return at;
}

void BrickMap::Layer::add(Brick& brick) {
  bricks.push_back(&brick);
  const auto put = [this](Brick& b) { slots[slot_of(b.block.y, b.block.x)] = &b; };
  if (2 * bricks.size() <= slots.size()) {
    put(*bricks.back());
    return;
  }
  slots.assign(2 * slots.size(), nullptr);
  for (Brick* const b : bricks) put(*b);
}

Brick& BrickMap::touch(const Block& b) {
  Layer& own = layers_[b.z];
  if (Brick* const there = own.find(b.y, b.x)) return *there;
  if (spare_.empty()) {
    slabs_.push_back(std::make_unique<Slab>());
    slabs_.back()->list(spare_);
  }
  Brick& brick = *spare_.back();
  spare_.pop_back();
  brick.extra.resize(512 * channels_);
  brick.block = b;
  brick.around.fill(nullptr);
  const auto rounds = static_cast<std::size_t>(rounds_);
  std::fill_n(brick.known.begin(), rounds + 1, BlockMask{});
  std::fill_n(brick.source.begin(), rounds, std::array<BlockMask, 2>{});
  brick.oblique = {};
  brick.straight = {};
  brick.active = {};
  brick.negative = {};
  brick.contested = {};
  brick.repaired = {};
  own.add(brick);
  for (std::int32_t dz = -1; dz <= 1; ++dz) {
    const auto layer = layers_.find(b.z + dz);
    if (layer == layers_.end()) continue;
    for (std::int32_t dy = -1; dy <= 1; ++dy) {
      for (std::int32_t dx = -1; dx <= 1; ++dx) {
        Brick* const other = layer->second.find(b.y + dy, b.x + dx);
        if (other == nullptr) continue;
        const auto i = static_cast<std::size_t>(dx + 1 + 3 * (dy + 1) + 9 * (dz + 1));
        brick.around[i] = other;
        other->around[26 - i] = &brick;
      }
    }
  }
  return brick;
}

std::vector<Brick*> BrickMap::take_lowest() {
  std::vector<Brick*> out = std::move(layers_.begin()->second.bricks);
  for (Brick* const brick : out)
    for (std::size_t i = 18; i < 27; ++i)
      if (brick->around[i] != nullptr) brick->around[i]->around[26 - i] = nullptr;
  layers_.erase(layers_.begin());
  // A node of OpenVDB's is 16 leaves wide.
  const auto key = [](const Block& b) { return std::array{b.y >> 4, b.x >> 4, b.y, b.x}; };
  std::sort(out.begin(), out.end(), [&](const Brick* a, const Brick* b) { return key(a->block) < key(b->block); });
  return out;
}

void BrickMap::give_back(const std::vector<Brick*>& bricks) {
  spare_.insert(spare_.end(), bricks.begin(), bricks.end());
}

void BrickMap::free_spare() {
  spare_ = std::vector<Brick*>();
  slabs_.clear();
}

GridFrame::GridFrame(const Frame& frame, const Lattice& lattice, int level)
    : voxel(frame.step * lattice.cell_size(level)) {
  // OpenVDB takes a smaller voxel for a singular transform.
  constexpr double kSmallest = 1.5e-5;
  if (voxel < kSmallest) {
    throw Error(ExitCode::usage, fmt::format("--vdb: a voxel of {:.3g} is smaller than OpenVDB holds ({:g}); give the "
                                             "points in smaller units (millimetres, not metres), or --vdb-voxelsize",
                                             voxel, kSmallest));
  }
  bool permuted = true;
  for (int k = 0; k < 3; ++k) {
    int largest = 0;
    permuted = permuted && frame.rotation.row(k).maxCoeff(&largest) == 1;
    axis_of[static_cast<std::size_t>(k)] = largest;
  }
  const openvdb::Vec3d origin(frame.origin[0], frame.origin[1], frame.origin[2]);
  if (permuted) {
    transform = openvdb::math::Transform::createLinearTransform(voxel);
    transform->postTranslate(origin);
    return;
  }
  axis_of = {0, 1, 2};
  openvdb::Mat4d m = openvdb::Mat4d::identity();
  for (int k = 0; k < 3; ++k)
    for (int a = 0; a < 3; ++a) m(k, a) = voxel * frame.rotation(k, a);  // OpenVDB multiplies row vectors from the left
  m.setTranslation(origin);
  transform = openvdb::math::Transform::createLinearTransform(m);
}

std::vector<ExtraGrid> resolve_grids(const std::vector<std::string>& names, const AttributeLayout& layout, double step,
                                     std::vector<int>& channels) {
  const auto red = find_attribute(layout, "red"), green = find_attribute(layout, "green"),
             blue = find_attribute(layout, "blue");
  const bool coloured = red && green && blue;
  const auto channel = [&](int c) {
    const auto at = std::find(channels.begin(), channels.end(), c);
    if (at != channels.end()) return static_cast<int>(at - channels.begin());
    channels.push_back(c);
    return static_cast<int>(channels.size()) - 1;
  };
  const auto attribute = [&](std::size_t i) { return channel(kFirstAttribute + static_cast<int>(i)); };
  std::vector<ExtraGrid> out;
  for (const std::string& word : names) {
    const bool automatic = word == VolumeExport::kColours;
    const std::string name = automatic ? "Cd" : word;
    if (automatic && !coloured) continue;
    if (std::any_of(out.begin(), out.end(), [&](const ExtraGrid& g) { return g.name == name; })) continue;
    if (name == "N") {
      out.push_back({name, ExtraGrid::Kind::normal, {}, 1});
    } else if (name == "Cd" && coloured) {
      out.push_back({name,
                     ExtraGrid::Kind::vector,
                     {attribute(*red), attribute(*green), attribute(*blue)},
                     1 / full_range(layout[*red].type)});
    } else if (name == "weight") {
      out.push_back({name, ExtraGrid::Kind::weight, {channel(kOffsetFromMean)}, 1});
    } else if (name == "curvature") {
      out.push_back({name, ExtraGrid::Kind::scalar, {channel(kCurvature)}, static_cast<float>(1 / step)});
    } else if (const auto i = find_attribute(layout, name)) {
      out.push_back({name, ExtraGrid::Kind::scalar, {attribute(*i)}, 1});
    } else {
      std::string known = coloured ? "N, Cd, weight, curvature" : "N, weight, curvature";
      for (const AttributeSpec& a : layout) known += ", " + a.name;
      throw Error(ExitCode::usage,
                  fmt::format("--vdb-grids {}: the points have no such attribute; there are {}", name, known));
    }
  }
  return out;
}

LeafMaker::LeafMaker(const Band& band, const GridFrame& grid, const std::vector<ExtraGrid>& extras,
                     const Eigen::Matrix3d& rotation, bool as_half)
    : band_(band), grid_(grid), extras_(extras), rotation_(rotation), half_(as_half) {
  // OpenVDB's z is the fastest.
  for (std::size_t k = 0; k < 3; ++k) axes_[k] = 2 - grid.axis_of[k];
  for (int at = 0; at < 512; ++at) {
    const int there = (at & 7) << (3 * axes_[0]) | (at >> 3 & 7) << (3 * axes_[1]) | (at >> 6) << (3 * axes_[2]);
    voxel_at_[static_cast<std::size_t>(there)] = static_cast<std::uint16_t>(at);
  }
}

void LeafMaker::operator()(const Brick& brick, BrickLeaves& out) const {
  out.any = false;
  if (!brick.active.any()) return;
  out.any = true;
  out.leaves.resize(1 + extras_.size());
  LeafMasks masks{with_axes(brick.active, axes_), with_axes(bits::fill_sides(brick.negative, band_.all(brick)), axes_)};
  std::array<std::uint16_t, 512> voxels;
  std::size_t count = 0;
  for (int x = 0; x < 8; ++x) {
    for (std::uint64_t w = masks.active.words[x]; w != 0; w &= w - 1) {
      voxels[count] = voxel_at_[x * 64 + std::countr_zero(w)];
      __builtin_prefetch(&brick.plane[voxels[count++]]);
    }
  }
  const Order order{voxels.data(), count};

  const openvdb::Coord origin = grid_.index({brick.block.x * 8, brick.block.y * 8, brick.block.z * 8});
  std::array<float, 3 * 512> values;
  const std::span<const float> scalars{values.data(), count}, vectors{values.data(), 3 * count};
  const auto voxel = static_cast<float>(grid_.voxel);
  for (std::size_t i = 0; i < count; ++i) values[i] = brick.distance(order[i]) * voxel;
  pack(origin, masks, scalars, 1, half_, out.leaves[0]);
  out.leaves[0].faces = face_votes(masks.active, masks.inside);

  masks.inside = {};
  for (std::size_t e = 0; e < extras_.size(); ++e) {
    const ExtraGrid& extra = extras_[e];
    if (extra.kind == ExtraGrid::Kind::scalar || extra.kind == ExtraGrid::Kind::weight) {
      fill_scalars(brick, extra, order, values.data());
      pack(origin, masks, scalars, 1, half_, out.leaves[1 + e]);
    } else {
      fill_vectors(brick, extra, order, values.data());
      pack(origin, masks, vectors, 3, half_, out.leaves[1 + e]);
    }
  }
}

void LeafMaker::fill_scalars(const Brick& brick, const ExtraGrid& extra, Order order, float* values) const {
  const float* const channel = &brick.extra[static_cast<std::size_t>(extra.channels[0]) * 512];
  for (std::size_t i = 0; i < order.size(); ++i) {
    const float value = extra.scale * channel[order[i]];
    // Extended beyond what was projected nothing speaks for a voxel but its neighbours.
    const float own = brick.known[0].test(order[i]) ? std::max(0.0F, 1 - value) : 0.0F;
    values[i] = extra.kind == ExtraGrid::Kind::weight ? own : value;
  }
}

void LeafMaker::fill_vectors(const Brick& brick, const ExtraGrid& extra, Order order, float* values) const {
  for (std::size_t i = 0; i < order.size(); ++i) {
    float* const v = &values[3 * i];
    if (extra.kind == ExtraGrid::Kind::vector) {
      for (std::size_t k = 0; k < 3; ++k)
        v[k] = extra.scale * brick.extra[static_cast<std::size_t>(extra.channels[k]) * 512 + order[i]];
    } else {
      const Plane& plane = brick.plane[order[i]];
      const Eigen::Vector3d n = rotation_.transpose() * Eigen::Vector3d(plane[0], plane[1], plane[2]);
      for (int k = 0; k < 3; ++k) v[k] = static_cast<float>(n[k]);
    }
  }
}

}  // namespace lamina::volume

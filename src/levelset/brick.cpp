#include "levelset/brick.h"

#include <sys/mman.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <memory>
#include <new>
#include <utility>

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

}  // namespace lamina::volume

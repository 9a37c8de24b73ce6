#include "volume/brick.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace lamina::volume {

std::size_t BrickMap::Layer::slot_of(std::int32_t y, std::int32_t x) const {
  // Neighbours along x lie side by side; rows are thrown far apart.
  constexpr std::uint32_t kFar = 0x9E3779B1;
  const std::size_t mask = slots.size() - 1;
  std::size_t at = (static_cast<std::uint32_t>(x) + static_cast<std::uint32_t>(y) * kFar) & mask;
  while (slots[at] != nullptr && (slots[at]->block.x != x || slots[at]->block.y != y)) at = (at + 1) & mask;
  return at;
}

void BrickMap::Layer::add(std::unique_ptr<Brick> brick) {
  bricks.push_back(std::move(brick));
  const auto put = [this](Brick& b) { slots[slot_of(b.block.y, b.block.x)] = &b; };
  if (2 * bricks.size() <= slots.size()) {
    put(*bricks.back());
    return;
  }
  slots.assign(2 * slots.size(), nullptr);
  for (const auto& b : bricks) put(*b);
}

Brick& BrickMap::touch(const Block& b) {
  Layer& own = layers_[b.z];
  if (Brick* const there = own.find(b.y, b.x)) return *there;
  std::unique_ptr<Brick> place;
  if (spare_.empty()) {
    place = std::make_unique_for_overwrite<Brick>();
    place->extra.resize(512 * channels_);
  } else {
    place = std::move(spare_.back());
    spare_.pop_back();
  }
  Brick& brick = *place;
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
  own.add(std::move(place));
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

std::vector<std::unique_ptr<Brick>> BrickMap::take_lowest() {
  std::vector<std::unique_ptr<Brick>> out = std::move(layers_.begin()->second.bricks);
  for (const auto& brick : out)
    for (std::size_t i = 18; i < 27; ++i)
      if (brick->around[i] != nullptr) brick->around[i]->around[26 - i] = nullptr;
  layers_.erase(layers_.begin());
  // A node of OpenVDB's is 16 leaves wide.
  const auto key = [](const Block& b) { return std::array{b.y >> 4, b.x >> 4, b.y, b.x}; };
  std::sort(out.begin(), out.end(), [&](const auto& a, const auto& b) { return key(a->block) < key(b->block); });
  return out;
}

void BrickMap::give_back(std::vector<std::unique_ptr<Brick>> bricks) {
  std::move(bricks.begin(), bricks.end(), std::back_inserter(spare_));
}

}  // namespace lamina::volume

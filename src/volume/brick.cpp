#include "volume/brick.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace lamina::volume {
namespace {

std::uint64_t key_of(std::int32_t y, std::int32_t x) {
  return std::uint64_t{static_cast<std::uint32_t>(y)} << 32 | static_cast<std::uint32_t>(x);
}

}  // namespace

Brick& BrickMap::touch(const Block& b) {
  std::unique_ptr<Brick>& place = layers_[b.z][key_of(b.y, b.x)];
  if (place != nullptr) return *place;
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
  std::fill_n(brick.known.begin(), rounds_ + 1, BlockMask{});
  std::fill_n(brick.source.begin(), std::min(rounds_ + 1, kMaxRounds), BlockMask{});
  brick.contested = {};
  brick.repaired = {};
  for (std::int32_t dz = -1; dz <= 1; ++dz) {
    const auto layer = layers_.find(b.z + dz);
    if (layer == layers_.end()) continue;
    for (std::int32_t dy = -1; dy <= 1; ++dy) {
      for (std::int32_t dx = -1; dx <= 1; ++dx) {
        const auto other = layer->second.find(key_of(b.y + dy, b.x + dx));
        if (other == layer->second.end()) continue;
        const auto i = static_cast<std::size_t>(dx + 1 + 3 * (dy + 1) + 9 * (dz + 1));
        brick.around[i] = other->second.get();
        other->second->around[26 - i] = &brick;
      }
    }
  }
  return brick;
}

std::vector<std::unique_ptr<Brick>> BrickMap::take_lowest() {
  std::vector<std::unique_ptr<Brick>> out;
  for (auto& [key, brick] : layers_.begin()->second) {
    for (std::size_t i = 18; i < 27; ++i)
      if (brick->around[i] != nullptr) brick->around[i]->around[26 - i] = nullptr;
    out.push_back(std::move(brick));
  }
  layers_.erase(layers_.begin());
  std::sort(out.begin(), out.end(), [](const auto& a, const auto& b) {
    return std::pair(a->block.y, a->block.x) < std::pair(b->block.y, b->block.x);
  });
  return out;
}

void BrickMap::give_back(std::vector<std::unique_ptr<Brick>> bricks) {
  std::move(bricks.begin(), bricks.end(), std::back_inserter(spare_));
}

}  // namespace lamina::volume

#include "samples/cell_blocks.h"

namespace lamina {
namespace {

std::size_t hash(const BlockKey& key) {
  const auto word = [](std::int32_t v) { return static_cast<std::uint64_t>(static_cast<std::uint32_t>(v)); };
  std::uint64_t h = (word(key.x) | word(key.y) << 32) * 0x9E3779B97F4A7C15U;
  h = (h ^ (h >> 32) ^ word(key.z)) * 0xD6E8FEB86659FD93U;
  return static_cast<std::size_t>(h ^ (h >> 32));
}

}  // namespace

std::size_t CellBlocks::slot_of(const BlockKey& key) const {
  const std::size_t mask = slots_.size() - 1;
  std::size_t slot = hash(key) & mask;
  while (slots_[slot].block != kNone && !(slots_[slot].key == key)) slot = (slot + 1) & mask;
  return slot;
}

std::uint32_t CellBlocks::find(const BlockKey& key) const {
  return slots_[slot_of(key)].block;
}

std::uint32_t CellBlocks::insert(const BlockKey& key) {
  std::size_t slot = slot_of(key);
  if (slots_[slot].block != kNone) return slots_[slot].block;
  if (2 * (blocks_.size() - free_.size() + 1) > slots_.size()) {
    rebuild(2 * slots_.size());
    slot = slot_of(key);
  }
  std::uint32_t block = 0;
  if (free_.empty()) {
    block = static_cast<std::uint32_t>(blocks_.size());
    blocks_.emplace_back();
  } else {
    block = free_.back();
    free_.pop_back();
    blocks_[block] = {};
  }
  blocks_[block].key = key;
  slots_[slot] = {key, block};
  layers_[key.z].push_back(block);
  return block;
}

std::vector<std::uint32_t> CellBlocks::between(std::int64_t z_begin, std::int64_t z_end) const {
  std::vector<std::uint32_t> found;
  for (const auto& [z, layer] : layers_) {
    const std::int64_t low = static_cast<std::int64_t>(z) * kBlockSide;
    if (low < z_end && low + kBlockSide > z_begin) found.insert(found.end(), layer.begin(), layer.end());
  }
  return found;
}

void CellBlocks::drop_below(std::int64_t z_end) {
  bool dropped = false;
  while (!layers_.empty() && (static_cast<std::int64_t>(layers_.begin()->first) + 1) * kBlockSide <= z_end) {
    const auto& layer = layers_.begin()->second;
    for (const std::uint32_t block : layer) blocks_[block].radii.reset();
    free_.insert(free_.end(), layer.begin(), layer.end());
    layers_.erase(layers_.begin());
    dropped = true;
  }
  if (dropped) rebuild(slots_.size());
}

void CellBlocks::rebuild(std::size_t slots) {
  slots_.assign(slots, {});
  for (const auto& [z, layer] : layers_) {
    for (const std::uint32_t block : layer) slots_[slot_of(blocks_[block].key)] = {blocks_[block].key, block};
  }
}

}  // namespace lamina

// Random access to corners and cells of any level for the few places that leave their tile: remembers the blocks met
// last.
#pragma once
#include <array>
#include <cstdint>
#include <utility>

#include "octree/window.h"

namespace lamina {

/// One thread's. The window must not gain or lose leaves while it is in use.
class BlockCache {
 public:
  explicit BlockCache(const Window& window) : window_(&window) {}

  [[nodiscard]] const CornerBlock* block(int level, const Cell& c) {
    const Block b = block_of(c);
    // Neighbouring blocks differ in a parity, so a walk around a corner keeps all of its eight blocks.
    Entry& e = entries_[static_cast<std::size_t>(level & 15) * 8 + (b.x & 1) + 2 * (b.y & 1) + 4 * (b.z & 1)];
    if (!e.known || e.block != b) e = {b, window_->probe(level, b), true};
    return e.leaf;
  }
  [[nodiscard]] bool test(int level, const Cell& c, BlockMask CornerBlock::*mask) {
    const CornerBlock* b = block(level, c);
    return b != nullptr && (b->*mask).test(offset_in_block(c));
  }
  [[nodiscard]] const Window& window() const { return *window_; }

 private:
  struct Entry {
    Block block;
    const CornerBlock* leaf = nullptr;
    bool known = false;
  };
  const Window* window_;
  std::array<Entry, 128> entries_{};
};

}  // namespace lamina

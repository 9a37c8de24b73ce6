// Numbers for cells of several levels: a hash table whose keys lie in it, so that most look-ups read nothing else.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/hashing.h"
#include "lattice/lattice.h"

namespace lamina {

/// Indices of forgotten cells are used again.
class CellTable {
 public:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;

  /// Index of a cell, kNone where there is none. Safe from several threads while nothing is added.
  [[nodiscard]] std::uint32_t find(const Cell& at, std::uint8_t level) const {
    return slots_[slot_of(at, level)].index;
  }

  struct Touched {
    std::uint32_t index = kNone;
    bool is_new = false;
  };
  /// Index of a cell, made if absent. Where that takes room, the cells that keep(cell, level) lets go are forgotten.
  template <typename Keep>
  Touched touch(const Cell& at, std::uint8_t level, const Keep& keep) {
    std::size_t slot = slot_of(at, level);
    if (slots_[slot].index != kNone) return {slots_[slot].index, false};
    if (2 * (size_ - free_.size() + 1) > slots_.size()) {
      rehash(keep);
      slot = slot_of(at, level);
    }
    if (free_.empty()) free_.push_back(static_cast<std::uint32_t>(size_++));
    const std::uint32_t index = free_.back();
    free_.pop_back();
    slots_[slot] = {at, index, level};
    return {index, true};
  }
  /// Indices are less than this.
  [[nodiscard]] std::size_t size() const { return size_; }

 private:
  struct Slot {
    Cell at;
    std::uint32_t index = kNone;
    std::uint8_t level = 0;
  };
  /// Where a cell is or would be.
  [[nodiscard]] std::size_t slot_of(const Cell& at, std::uint8_t level) const {
    std::size_t slot = cell_hash(at.x, at.y, at.z + (std::int64_t{level} << 32)) & (slots_.size() - 1);
    while (slots_[slot].index != kNone && (slots_[slot].at != at || slots_[slot].level != level))
      slot = (slot + 1) & (slots_.size() - 1);
    return slot;
  }
  /// Makes room until the table is at most a quarter full.
  template <typename Keep>
  void rehash(const Keep& keep) {
    std::vector<Slot> kept;
    kept.reserve(slots_.size() / 2);
    for (const Slot& slot : slots_) {
      if (slot.index == kNone) continue;
      if (keep(slot.at, slot.level)) {
        kept.push_back(slot);
      } else {
        free_.push_back(slot.index);
      }
    }
    std::size_t size = slots_.size();
    while (4 * (kept.size() + 1) > size) size *= 2;
    slots_.assign(size, {});
    for (const Slot& slot : kept) slots_[slot_of(slot.at, slot.level)] = slot;
  }

  std::vector<Slot> slots_ = std::vector<Slot>(64);  ///< a power of two, at most half full
  std::vector<std::uint32_t> free_;
  std::size_t size_ = 0;
};

}  // namespace lamina

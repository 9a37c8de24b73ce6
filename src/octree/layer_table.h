// The leaves of one layer of blocks by place. Pages are made where there are leaves: a scan is often thousands of its
// finest blocks wide, and a surface fills little of each layer.
#pragma once
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "octree/corner_block.h"

namespace lamina {

/// A piece of a table, of any layer of any level.
class TablePage {
 public:
  static constexpr std::int32_t kSide = 16;  ///< blocks

  [[nodiscard]] CornerBlock*& at(std::int32_t x, std::int32_t y) {
    return blocks_[static_cast<std::size_t>(y % kSide * kSide + x % kSide)];
  }

 private:
  std::array<CornerBlock*, kSide * kSide> blocks_{};
};

/// Where the tables of a level have places, in blocks. Empty (the default): nowhere.
struct TableExtent {
  std::int32_t x0 = 0, y0 = 0, nx = 0, ny = 0;

  [[nodiscard]] static std::size_t pages_along(std::int32_t blocks) {
    return (static_cast<std::size_t>(blocks) + TablePage::kSide - 1) / TablePage::kSide;
  }
  [[nodiscard]] std::size_t pages() const { return pages_along(nx) * pages_along(ny); }
};

/// A table of more pages than this takes more memory, even without leaves, than it saves time.
inline constexpr std::size_t kMostTablePages = std::size_t{1} << 15;

/// Pages without leaves, used again: layers come and go all the time.
using SparePages = std::vector<std::unique_ptr<TablePage>>;

class LayerTable {
 public:
  LayerTable() = default;
  explicit LayerTable(const TableExtent& extent)
      : extent_(extent), pages_across_(TableExtent::pages_along(extent.nx)), pages_(extent.pages(), nullptr) {}

  /// Whether the table knows of a leaf there, if there is one.
  [[nodiscard]] bool covers(std::int32_t x, std::int32_t y) const {
    x -= extent_.x0;
    y -= extent_.y0;
    return x >= 0 && y >= 0 && x < extent_.nx && y < extent_.ny;
  }

  /// The leaf of a place that the table covers; null where there is none. Safe while another thread calls set().
  [[nodiscard]] CornerBlock* find(std::int32_t x, std::int32_t y) const {
    TablePage* const page = std::atomic_ref(pages_[page_of(x, y)]).load(std::memory_order_acquire);
    if (page == nullptr) return nullptr;
    return std::atomic_ref(page->at(x - extent_.x0, y - extent_.y0)).load(std::memory_order_acquire);
  }

  /// The leaves of a place and of the eight around it, [y][x], where the table covers all nine and one page has them.
  [[nodiscard]] std::optional<std::array<CornerBlock*, 9>> find_around(std::int32_t x, std::int32_t y) const {
    const std::int32_t in_x = (x - extent_.x0) % TablePage::kSide;
    const std::int32_t in_y = (y - extent_.y0) % TablePage::kSide;
    const auto inner = [](std::int32_t v) { return v > 0 && v + 1 < TablePage::kSide; };
    if (!inner(in_x) || !inner(in_y) || !covers(x - 1, y - 1) || !covers(x + 1, y + 1)) return std::nullopt;
    std::array<CornerBlock*, 9> out{};
    TablePage* const page = std::atomic_ref(pages_[page_of(x, y)]).load(std::memory_order_acquire);
    if (page == nullptr) return out;
    for (std::size_t i = 0, dy = 0; dy < 3; ++dy) {
      for (std::size_t dx = 0; dx < 3; ++dx, ++i) {
        CornerBlock*& at = page->at(in_x - 1 + static_cast<std::int32_t>(dx), in_y - 1 + static_cast<std::int32_t>(dy));
        out[i] = std::atomic_ref(at).load(std::memory_order_acquire);
      }
    }
    return out;
  }

  /// At a place that the table covers. One thread at a time.
  void set(std::int32_t x, std::int32_t y, CornerBlock* block, SparePages& spare) {
    TablePage*& page = pages_[page_of(x, y)];
    if (page == nullptr) {
      std::unique_ptr<TablePage> made;
      if (spare.empty()) {
        made = std::make_unique<TablePage>();
      } else {
        made = std::move(spare.back());
        spare.pop_back();
      }
      used_.push_back(std::move(made));
      std::atomic_ref(page).store(used_.back().get(), std::memory_order_release);
    }
    std::atomic_ref(page->at(x - extent_.x0, y - extent_.y0)).store(block, std::memory_order_release);
  }

  /// Forgets all leaves.
  void clear(SparePages& spare) {
    for (std::unique_ptr<TablePage>& page : used_) {
      *page = {};
      spare.push_back(std::move(page));
    }
    used_.clear();
    pages_.assign(pages_.size(), nullptr);
  }

  [[nodiscard]] std::size_t memory() const {
    return pages_.capacity() * sizeof(TablePage*) + used_.size() * sizeof(TablePage);
  }

 private:
  [[nodiscard]] std::size_t page_of(std::int32_t x, std::int32_t y) const {
    return static_cast<std::size_t>((y - extent_.y0) / TablePage::kSide) * pages_across_ +
           static_cast<std::size_t>((x - extent_.x0) / TablePage::kSide);
  }

  TableExtent extent_;
  std::size_t pages_across_ = 0;
  mutable std::vector<TablePage*> pages_;  ///< atomic_ref takes no constant, though it is only read
  std::vector<std::unique_ptr<TablePage>> used_;
};

}  // namespace lamina

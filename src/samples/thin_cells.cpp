#include "samples/thin_cells.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cstddef>

#include "base/hashing.h"

namespace lamina {
namespace {

constexpr std::uint32_t kNone = 0xFFFFFFFFU;

/// The cells that samples lie in, by open addressing.
class CellSums {
 public:
  struct Entry {
    Cell cell;
    std::uint8_t level = 0;
    float x = 0, y = 0, z = 0, count = 0;  ///< of the normals
  };

  explicit CellSums(std::size_t samples) : slots_(std::bit_ceil(2 * samples + 2), kNone) {}

  std::uint32_t touch(const Cell& cell, std::uint8_t level) {
    std::uint32_t& slot = slots_[find_slot(cell, level)];
    if (slot == kNone) {
      slot = static_cast<std::uint32_t>(entries_.size());
      entries_.push_back({cell, level});
    }
    return slot;
  }
  [[nodiscard]] const Entry* find(const Cell& cell, std::uint8_t level) const {
    const std::uint32_t slot = slots_[find_slot(cell, level)];
    return slot == kNone ? nullptr : &entries_[slot];
  }
  [[nodiscard]] Entry& at(std::uint32_t i) { return entries_[i]; }
  [[nodiscard]] const std::vector<Entry>& entries() const { return entries_; }

 private:
  [[nodiscard]] std::size_t find_slot(const Cell& cell, std::uint8_t level) const {
    std::size_t at = cell_hash(cell.x, cell.y, cell.z + (std::int64_t{level} << 32)) & (slots_.size() - 1);
    while (slots_[at] != kNone && (entries_[slots_[at]].cell != cell || entries_[slots_[at]].level != level))
      at = (at + 1) & (slots_.size() - 1);
    return at;
  }
  std::vector<std::uint32_t> slots_;
  std::vector<Entry> entries_;
};

bool is_thin(const CellSums& sums, const CellSums::Entry& entry) {
  float x = 0, y = 0, z = 0, count = 0;
  for (int i = 0; i < 27; ++i) {
    const CellSums::Entry* e = sums.find(entry.cell + Cell{i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1}, entry.level);
    if (e == nullptr) continue;
    x += e->x;
    y += e->y;
    z += e->z;
    count += e->count;
  }
  return x * x + y * y + z * z < kThin * kThin * count * count;
}

}  // namespace

void refine_thin(const Lattice& lattice, const LocalSamples& samples, const std::vector<float>& radius,
                 std::vector<std::uint8_t>& level) {
  const std::size_t n = samples.size();
  CellSums sums(n);
  std::vector<std::uint32_t> cell_of(n, kNone);
  for (std::size_t i = 0; i < n; ++i) {
    if (!(radius[i] > 0) || level[i] == 0) continue;
    const std::int32_t side = lattice.cell_size(level[i]);
    const Cell cell{floor_div(samples.x[i], side), floor_div(samples.y[i], side), floor_div(samples.z[i], side)};
    cell_of[i] = sums.touch(cell, level[i]);
    CellSums::Entry& e = sums.at(cell_of[i]);
    e.x += samples.nx[i];
    e.y += samples.ny[i];
    e.z += samples.nz[i];
    e.count += 1;
  }
  const auto& entries = sums.entries();
  std::vector<std::uint8_t> thin(entries.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, entries.size(), 4096), [&](const auto& range) {
    for (std::size_t e = range.begin(); e < range.end(); ++e) thin[e] = is_thin(sums, entries[e]) ? 1 : 0;
  });
  for (std::size_t i = 0; i < n; ++i) {
    if (cell_of[i] != kNone) level[i] = static_cast<std::uint8_t>(level[i] - thin[cell_of[i]]);
  }
}

}  // namespace lamina

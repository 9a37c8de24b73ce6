// What the search finds for each row, on its way from the window, which has samples by place, to the order of the rows.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "edit/rows.h"
#include "normals/sides.h"

namespace lamina::normals {

/// Six bytes: a packed unit normal, or what is to be done with the input's.
using NormalCode = std::array<std::uint16_t, 3>;

/// Packed normals never have both coordinates' first 16 bits and a low byte 0.
inline constexpr NormalCode kKeep{0, 0, 0};
inline constexpr NormalCode kTurn{0, 1, 0};
inline constexpr NormalCode kNoNormal{0, 2, 0};
NormalCode code_of(const std::array<float, 3>& normal);
/// The normals of codes, one after another; of those that hold none, anything finite.
void unpack_codes(std::span<const NormalCode> codes, const std::array<float*, 3>& normals);

/// A row's normal before its patch has a sign; no gaps between its bytes.
struct RowRecord {
  NormalCode code = kKeep;
  std::array<std::uint16_t, 2> node_parts{0xFFFF, 0xFFFF};

  RowRecord() = default;  ///< of a row that nothing is found for
  RowRecord(const NormalCode& its_code, std::uint32_t node)
      : code(its_code), node_parts{static_cast<std::uint16_t>(node), static_cast<std::uint16_t>(node >> 16)} {}
  [[nodiscard]] std::uint32_t node() const { return node_parts[0] | std::uint32_t{node_parts[1]} << 16; }
};
static_assert(sizeof(RowRecord) == 10);

/// Gives the records' normals the signs of their patches.
void apply_signs(std::span<RowRecord> records, const PatchSigns& signs);

/// At most one record for each row: in one array as long as this takes no more than `memory`, else sorted by way of the
/// disk within that.
class RowRecords {
 public:
  RowRecords(std::uint64_t rows, std::size_t memory, std::string directory);
  /// Throws Error(budget) when the directory cannot take them.
  void add(std::span<const std::uint64_t> rows, std::span<const RowRecord> records);

  /// Whether drain() is how to get at them.
  [[nodiscard]] bool on_disk() const { return sorter_ != nullptr; }
  /// All rows' records, once. None at all: nothing was added.
  [[nodiscard]] std::vector<RowRecord> take() { return std::move(by_row_); }
  /// Gives the records back by ascending row, in batches of at most `batch`, once; these may be changed.
  using Take = std::function<void(std::span<const std::uint64_t>, std::span<RowRecord>)>;
  void drain(std::size_t batch, const Take& take);

 private:
  std::uint64_t rows_;
  std::vector<RowRecord> by_row_;  ///< empty until there is one
  std::unique_ptr<edit::RecordSorter> sorter_;
};

}  // namespace lamina::normals

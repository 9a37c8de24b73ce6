// What became of each row's normal, in the order of the rows, on disk; and the rows with their normals.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <string>

#include "base/spill_file.h"
#include "edit/record_sorter.h"
#include "lamina/points.h"
#include "normals/patch_graph.h"

namespace lamina::normals {

/// Six bytes: a packed unit normal, or what is to be done with the input's.
using NormalCode = std::array<std::uint16_t, 3>;

/// Packed normals never have both coordinates' first 16 bits and a low byte 0.
inline constexpr NormalCode kKeep{0, 0, 0};
inline constexpr NormalCode kTurn{0, 1, 0};
inline constexpr NormalCode kNoNormal{0, 2, 0};
NormalCode code_of(const std::array<float, 3>& normal);

/// A row's normal before its patch has a sign.
struct RowRecord {
  NormalCode code;
  std::uint32_t node = 0;
};
inline constexpr std::size_t kRecordBytes = 10;

class RowNormals {
 public:
  /// Gives the records' normals the signs of their patches. Rows without a record keep what the input has for them, or
  /// have none where it has none.
  RowNormals(edit::RecordSorter& records, const PatchSigns& signs, std::uint64_t rows, const std::string& directory,
             const RunContext& run);
  /// Sets the batch's normals. Safe from several threads.
  void apply(SampleBatch& batch) const;

 private:
  SpillFile file_;
};

/// The rows of a source with these normals.
std::unique_ptr<PointSource> give_normals(std::unique_ptr<PointSource> source, std::unique_ptr<RowNormals> normals);

}  // namespace lamina::normals

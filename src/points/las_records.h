// The point records of a LAS file, whether they stand there as they are or compressed in chunks (LAZ).
#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "laz/chunks.h"
#include "points/binary_rows.h"
#include "points/input_file.h"
#include "points/las_header.h"

namespace lamina {

/// From any thread.
class LasRecords {
 public:
  virtual ~LasRecords() = default;
  LasRecords(const LasRecords&) = delete;
  LasRecords& operator=(const LasRecords&) = delete;

  /// Hands the records of the rows over, in order and in pieces. Bytes that are not wanted may hold anything. Throws
  /// Error(unreadable) naming file and place.
  virtual void read(RowRange rows, const laz::WantedBytes& wanted, const TakeRows& take) const = 0;

  [[nodiscard]] std::uint64_t count() const { return count_; }
  /// What the user should know, one line each.
  [[nodiscard]] const std::vector<std::string>& remarks() const { return remarks_; }

 protected:
  LasRecords() = default;
  std::uint64_t count_ = 0;
  std::vector<std::string> remarks_;
};

/// All records, or of COPC those of the octree's nodes that the selection asks for. `file` and `header` must outlive
/// them. Throws Error(unreadable), and Error(usage) where the selection asks for nodes and there are none.
std::unique_ptr<LasRecords> open_las_records(const InputFile& file, const LasHeader& header,
                                             const PointSelection& selection);

}  // namespace lamina

// The positions of a source, each with the number of its row: for jobs that look at neighbours and come back to rows.
#pragma once
#include <cstdint>
#include <vector>

#include "lamina/points.h"

namespace lamina {

/// Rows as ingest() takes them, radii and qualities left away, the row's number as attributes. Normals are the
/// source's, and (0, 0, 1) where it has none that is usable.
class NumberedRows final : public PointSource {
 public:
  static constexpr std::size_t kDigits = 3;  ///< of a row's number, 16 bits each: the store keeps them in two bytes

  explicit NumberedRows(PointSource& source);
  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override;

 private:
  PointSource& source_;
};

/// The number of the row that sample i came from.
std::uint64_t row_of(const std::vector<std::vector<float>>& attributes, std::size_t i);

}  // namespace lamina

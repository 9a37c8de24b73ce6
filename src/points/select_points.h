// Points of a file that somebody wants: by class, return, or any value.
#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "lamina/points.h"
#include "points/point_columns.h"

namespace lamina {

/// Values of points that are none of their source's attributes: nobody carries them, but they may be selected by. What
/// sources are, too. From any thread.
class HiddenValues {
 public:
  virtual ~HiddenValues() = default;
  /// The names of las_fields().
  [[nodiscard]] virtual bool has_hidden(std::string_view name) const = 0;
  /// How many points are of each class; empty where they have none.
  [[nodiscard]] virtual std::vector<std::uint64_t> class_counts() const = 0;
  /// Those of the names, which it has, for the rows: an array for each.
  virtual void read_hidden(const std::vector<std::string>& names, RowRange rows,
                           std::vector<std::vector<double>>& values) const = 0;

 protected:
  HiddenValues() = default;
  HiddenValues(const HiddenValues&) = default;
  HiddenValues& operator=(const HiddenValues&) = default;
};

/// The points of the source that are selected; itself where that is all of them. Reads it once to count them, in
/// parallel where it is random_access, but not for classes that none of its points is of. A remark says how many are
/// left out. Memory: 8 bytes for 4096 rows. Throws Error(usage) for values that it does not have.
std::unique_ptr<PointSource> select_points(std::unique_ptr<PointSource> source, const PointSelection& selection);

}  // namespace lamina

// Which fields of an E57 scan become which columns, and how.
#pragma once
#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "e57/contents.h"
#include "e57/paged_file.h"
#include "points/point_columns.h"

namespace lamina {

/// A field that says which values of a point mean nothing: those where it is not 0.
struct E57Flag {
  std::size_t field = 0;
};

struct E57Column {
  std::size_t field = 0;
  PointColumn column;
  double scale = 1, shift = 0;        ///< value = scale * field + shift
  bool whole = false;                 ///< rounded then
  std::optional<std::size_t> flag{};  ///< index of the flag that speaks of it
};

struct E57Columns {
  std::vector<E57Column> columns;
  std::vector<E57Flag> flags;
  std::optional<std::size_t> invalid;  ///< index of the flag that speaks of the point itself
  bool by_angles = false;              ///< x y z are range, azimuth and elevation (radians)
  bool double_precision = false;
};

/// Positions, normals (extension `nor`), colours, intensity, and the numbers of other extensions under their own names.
/// Colours and intensity by their limits: those of 8 bits and of 16 bits as such, intensity of any others as 0 to 1.
/// Throws Error(unreadable) for a scan without positions.
E57Columns e57_columns(const e57::Scan& scan, const e57::PagedFile& file);

/// The fields of the row and the column, where points have those of a scanner's grid.
std::optional<std::array<std::size_t, 2>> e57_grid_fields(const e57::Scan& scan);

}  // namespace lamina

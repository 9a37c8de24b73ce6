// Which fields of an E57 scan become which columns, and how; the grid that its points have.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "e57/e57.h"
#include "points/point_columns.h"
#include "points/scans.h"

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

// The scanner's grid behind the points of an E57 scan, from the row and column that each has.

/// The order in which a scanner swept its grid. Sees all points twice: once to tell the order, once to mark places.
class E57GridOrder {
 public:
  static constexpr std::int64_t kLargest = std::int64_t{1} << 30;
  /// The next point's row and column, at most kLargest either way.
  void add(std::int64_t row, std::int64_t column);
  /// After all points: an empty grid where they stand line by line, in one direction each, every place once; nothing
  /// for others, and for a grid most places of which are missing.
  std::shared_ptr<ScanGrid> grid();
  /// All points again: marks their places in the grid.
  void mark(std::int64_t row, std::int64_t column, ScanGrid& grid);

 private:
  using Place = std::array<std::int64_t, 2>;  ///< line, place in the line

  /// Lines are rows or columns; either may count up or down.
  struct Order {
    bool by_columns, lines_down, places_down;
    bool possible = true;
  };
  [[nodiscard]] static Place place(const Order& order, std::int64_t row, std::int64_t column);

  std::array<Order, 8> orders_{{{true, false, false},
                                {true, false, true},
                                {true, true, false},
                                {true, true, true},
                                {false, false, false},
                                {false, false, true},
                                {false, true, false},
                                {false, true, true}}};
  std::uint64_t points_ = 0, marked_ = 0;
  std::array<std::int64_t, 2> last_{}, low_{}, high_{};  ///< row, column
  Order order_{};
  Place first_{};             ///< in the order
  std::uint64_t length_ = 0;  ///< places of a line
};

}  // namespace lamina

// The scanner's grid behind the points of an E57 scan, from the row and column that each has.
#pragma once
#include <array>
#include <cstdint>
#include <memory>

#include "points/scans.h"

namespace lamina {

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

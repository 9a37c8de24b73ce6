#include "points/e57_grid.h"

#include <algorithm>

namespace lamina {
namespace {

/// Scanners see a good part of the places; more than so many without a point are no scanner's.
constexpr std::uint64_t kMostPlaces = 64;

}  // namespace

E57GridOrder::Place E57GridOrder::place(const Order& order, std::int64_t row, std::int64_t column) {
  const std::int64_t line = order.by_columns ? column : row;
  const std::int64_t at = order.by_columns ? row : column;
  return {order.lines_down ? -line : line, order.places_down ? -at : at};
}

void E57GridOrder::add(std::int64_t row, std::int64_t column) {
  if (points_++ == 0) low_ = high_ = {row, column};
  low_ = {std::min(low_[0], row), std::min(low_[1], column)};
  high_ = {std::max(high_[0], row), std::max(high_[1], column)};
  for (Order& order : orders_) {
    if (points_ > 1 && !(place(order, last_[0], last_[1]) < place(order, row, column))) order.possible = false;
  }
  last_ = {row, column};
}

std::shared_ptr<ScanGrid> E57GridOrder::grid() {
  const auto found = std::find_if(orders_.begin(), orders_.end(), [](const Order& order) { return order.possible; });
  if (points_ < 2 || found == orders_.end()) return nullptr;
  order_ = *found;
  const Place a = place(order_, low_[0], low_[1]);
  const Place b = place(order_, high_[0], high_[1]);
  first_ = {std::min(a[0], b[0]), std::min(a[1], b[1])};
  const auto lines = static_cast<std::uint64_t>(std::max(a[0], b[0]) - first_[0] + 1);
  length_ = static_cast<std::uint64_t>(std::max(a[1], b[1]) - first_[1] + 1);
  if (lines * length_ > kMostPlaces * points_) return nullptr;
  return std::make_shared<ScanGrid>(length_);
}

void E57GridOrder::mark(std::int64_t row, std::int64_t column, ScanGrid& grid) {
  const Place at = place(order_, row, column);
  const std::uint64_t index =
      static_cast<std::uint64_t>(at[0] - first_[0]) * length_ + static_cast<std::uint64_t>(at[1] - first_[1]);
  for (; marked_ < index; ++marked_) grid.add(false);
  grid.add(true);
  ++marked_;
}

}  // namespace lamina

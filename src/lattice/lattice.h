// Integer geometry of the multi-level lattice: levels, cells, corners, slabs, and where a cloud lies on it (Cuccuru et
// al. 2009, section 3.4).
#pragma once
#include <array>
#include <cstdint>

namespace lamina {

/// Coordinates of a cell, or of a corner (the cell's lower end), in units of its level's cells. z is the sweep axis.
struct Cell {
  std::int32_t x = 0, y = 0, z = 0;
  bool operator==(const Cell&) const = default;
  auto operator<=>(const Cell&) const = default;
  Cell operator+(const Cell& o) const { return {x + o.x, y + o.y, z + o.z}; }
};

/// Division rounding down; `b` > 0.
constexpr std::int32_t floor_div(std::int32_t a, std::int32_t b) {
  const std::int32_t q = a / b;
  return q - static_cast<std::int32_t>(a % b != 0 && a < 0);
}

/// One global lattice; level 0 is the finest, sizes double per level, all levels share the origin (fixed-point zero).
/// A slab is one layer of cells of the coarsest level.
struct Lattice {
  std::int32_t cell = 1;  ///< edge of a level-0 cell in fixed-point steps, >= 1
  int levels = 4;         ///< number of levels, 1..12

  [[nodiscard]] std::int32_t cell_size(int level) const { return cell << level; }
  [[nodiscard]] std::int32_t slab_height() const { return cell << (levels - 1); }  ///< steps
  [[nodiscard]] int layers(int level) const { return 1 << (levels - 1 - level); }  ///< level's cell layers in a slab
  /// First layer (z coordinate of cells) of a slab at a level.
  [[nodiscard]] std::int32_t first_layer(int level, std::int32_t slab) const { return slab * layers(level); }
  /// Slab that owns a layer of cells or corners: the corner plane z = first_layer(level, s) belongs to slab s.
  [[nodiscard]] std::int32_t slab_of_layer(int level, std::int32_t z) const { return z >> (levels - 1 - level); }
  [[nodiscard]] std::int32_t slab_of(std::int32_t fixed_z) const { return floor_div(fixed_z, slab_height()); }
  /// Fixed-point position of a corner.
  [[nodiscard]] std::array<std::int32_t, 3> position(int level, const Cell& c) const {
    const std::int32_t a = cell_size(level);
    return {c.x * a, c.y * a, c.z * a};
  }
};

/// Cross-section of the cloud in fixed-point steps, inclusive.
struct Bounds {
  std::int32_t x_min = 0, x_max = -1, y_min = 0, y_max = -1;
};

/// Where the samples lie, fixed-point, inclusive.
struct Extent : Bounds {
  std::int32_t z_min = 0, z_max = -1;
};

/// Exact floor division of fixed-point coordinates by one positive divisor, fast enough for every sample:
/// floor((value - origin) / divisor) for int32 values, origin and divisor; divisor > 0. Half a step is added before
/// multiplying by the reciprocal, which keeps the quotient at least 1/(2 divisor) away from an integer: far more than
/// the rounding of a double, so the result is exact. Compiles to vector code in loops, which an integer division does
/// not.
class FloorDivider {
 public:
  explicit FloorDivider(std::int32_t divisor, std::int32_t origin = 0)
      : reciprocal_(1.0 / divisor), shift_(0.5 - static_cast<double>(origin)) {}
  /// The quotient must fit 32 bits: true for origin 0, and otherwise when |value - origin| / divisor does.
  [[nodiscard]] std::int32_t operator()(std::int32_t value) const {
    const double quotient = (static_cast<double>(value) + shift_) * reciprocal_;
    const auto truncated = static_cast<std::int32_t>(quotient);
    return truncated - static_cast<std::int32_t>(static_cast<double>(truncated) > quotient);
  }

 private:
  double reciprocal_;
  double shift_;
};

}  // namespace lamina

#include "mls/crease_seats.h"

#include <array>
#include <cmath>

#include "mls/sheets.h"

namespace lamina {
namespace {

constexpr std::array<Cell, 6> kBeside{Cell{-1, 0, 0}, Cell{1, 0, 0},  Cell{0, -1, 0},
                                      Cell{0, 1, 0},  Cell{0, 0, -1}, Cell{0, 0, 1}};

/// A corner's crease point, seen from it.
struct Reach {
  Cell cube;         ///< the corner in whose cube the point lies
  double distance2;  ///< from the corner, cells
};

class Neighbours {
 public:
  Neighbours(const Window& window, int level, std::int32_t slab) : window_(window), level_(level), slab_(slab) {}

  /// The record of a trusted corner; null where there is none.
  [[nodiscard]] const float* record(const Cell& c) {
    const std::int32_t slab = window_.lattice().slab_of_layer(level_, c.z);
    if (slab < slab_ - 1 || slab > slab_ + 1) {
      known_ = false;
      return nullptr;
    }
    const CornerBlock* const block = window_.probe(level_, block_of(c));
    const int offset = offset_in_block(c);
    if (block == nullptr || !block->trusted.test(offset)) return nullptr;
    const CornerValues& values = block->values[window_.slab_in_leaf(level_, offset >> 6)];
    return values.count == 0 ? nullptr : values.of(block->value_index(offset, window_.slab_layers(level_)));
  }
  /// Whether the surface crosses an edge of the corner in its half.
  [[nodiscard]] bool has_vertex(const Cell& c) {
    const float* const own = record(c);
    if (own == nullptr) return false;
    for (const Cell& step : kBeside) {
      const float* const other = record(c + step);
      if (other == nullptr) continue;
      if ((own[kDistance] < 0) != (other[kDistance] < 0) && std::abs(own[kDistance]) <= std::abs(other[kDistance]))
        return true;
    }
    return false;
  }
  [[nodiscard]] bool known() const { return known_; }  ///< nothing that was asked for lies too far up or down

 private:
  const Window& window_;
  int level_;
  std::int32_t slab_;
  bool known_ = true;
};

bool reach_of(const Cell& corner, const float* record, Reach& out) {
  meshes::Vec3 place{};
  meshes::Vec3 normal{};
  if (!unpacked_crease(record + kCrease, place, normal)) return false;
  const auto whole = [](double v) {
    return static_cast<std::int32_t>(v > kOwnCube) - static_cast<std::int32_t>(v < -kOwnCube);
  };
  out.cube = corner + Cell{whole(place[0]), whole(place[1]), whole(place[2])};
  out.distance2 = meshes::dot(place, place);
  return true;
}

}  // namespace

bool takes_crease(const Window& window, int level, const Cell& corner, std::int32_t slab, const float* record) {
  Reach own{};
  if (!reach_of(corner, record, own)) return false;
  if (own.cube == corner) return true;
  Neighbours around(window, level, slab);
  if (around.has_vertex(own.cube) || !around.has_vertex(corner)) return false;
  bool passed = false;  // the corner itself: of equally near ones the first takes it
  for (int dz = -1; dz <= 1; ++dz) {
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const Cell c = own.cube + Cell{dx, dy, dz};
        if (c == corner) {
          passed = true;
          continue;
        }
        const float* const other = around.record(c);
        Reach reach{};
        if (other == nullptr || !reach_of(c, other, reach) || reach.cube != own.cube) continue;
        const bool nearer = passed ? reach.distance2 < own.distance2 : reach.distance2 <= own.distance2;
        if (nearer && around.has_vertex(c)) return false;
      }
    }
  }
  return around.known();
}

}  // namespace lamina

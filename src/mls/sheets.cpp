#include "mls/sheets.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <tuple>

namespace lamina {
namespace {

using meshes::Vec3;
using meshes::operator+;
using meshes::operator-;
using meshes::operator*;
using meshes::cross;
using meshes::dot;
using meshes::norm;
using meshes::unit;

/// Planes with a greater cosine either way meet too far away, or nowhere.
constexpr double kParallel = 0.95;
/// What counts as on the surface, cells.
constexpr double kOn = 1e-3;
/// Sheets bend: points where they meet are found by so many steps along their tangent planes.
constexpr int kSteps = 3;

enum class Bend { convex, concave, neither };

/// How two sheets meet: the samples of each lie below the other at a convex edge, above it at a concave one.
Bend bend_of(const Sheet& a, const Sheet& b) {
  const double a_over_b = b.at(a.mean);
  const double b_over_a = a.at(b.mean);
  if (a_over_b < 0 && b_over_a < 0) return Bend::convex;
  if (a_over_b > 0 && b_over_a > 0) return Bend::concave;
  return Bend::neither;
}

/// Sheets in the order in which they are put together: the first two by `inner`, the third by `outer`.
struct Combination {
  std::array<std::size_t, 3> order{0, 1, 2};
  Bend inner = Bend::convex, outer = Bend::convex;
};

double joined(Bend bend, double a, double b) {
  return bend == Bend::convex ? std::max(a, b) : std::min(a, b);
}

class Surface {
 public:
  Surface(const std::array<Sheet, 3>& sheets, std::size_t count) : sheets_(sheets), count_(count) {}

  /// False where two sheets do not meet in an edge.
  bool find_combination() {
    if (count_ < 2) return true;
    const Bend first = bend_of(sheets_[0], sheets_[1]);
    if (count_ == 2) {
      c_.inner = first;
      return first != Bend::neither;
    }
    for (std::size_t third = 3; third-- > 0;) {
      if (joins_last(third)) return true;
    }
    return false;
  }

  [[nodiscard]] double at(const Vec3& x) const {
    const double first = sheets_[c_.order[0]].at(x);
    if (count_ == 1) return first;
    const double two = joined(c_.inner, first, sheets_[c_.order[1]].at(x));
    return count_ == 2 ? two : joined(c_.outer, two, sheets_[c_.order[2]].at(x));
  }
  [[nodiscard]] bool holds(const Vec3& x) const { return std::abs(at(x)) <= kOn; }

  /// Whether two sheets meet in an edge that the third one ends. Its own samples may lie on either side of one of them,
  /// as those of a wall beside a step do.
  bool joins_last(std::size_t third) {
    const std::size_t a = (third + 1) % 3;
    const std::size_t b = (third + 2) % 3;
    const Bend inner = bend_of(sheets_[a], sheets_[b]);
    if (inner == Bend::neither) return false;
    const double over_a = sheets_[third].at(sheets_[a].mean);
    const double over_b = sheets_[third].at(sheets_[b].mean);
    const double over = joined(inner, sheets_[a].at(sheets_[third].mean), sheets_[b].at(sheets_[third].mean));
    if ((over_a < 0) != (over_b < 0) || (over_a < 0) != (over < 0)) return false;
    c_ = {{a, b, third}, inner, over < 0 ? Bend::convex : Bend::concave};
    return true;
  }

  /// The point of the edge of two sheets that is nearest to the corner.
  [[nodiscard]] bool edge(std::size_t j, std::size_t k, Vec3& x) const {
    x = {};
    for (int step = 0; step < kSteps; ++step) {
      const Vec3 a = sheets_[j].normal_at(x);
      const Vec3 b = sheets_[k].normal_at(x);
      const double g = dot(a, b);
      if (std::abs(g) > kParallel) return false;
      const double ca = dot(a, x) - sheets_[j].at(x);
      const double cb = dot(b, x) - sheets_[k].at(x);
      const double scale = 1 / (1 - g * g);
      x = (scale * (ca - g * cb)) * a + (scale * (cb - g * ca)) * b;
    }
    return std::abs(sheets_[j].at(x)) <= kOn && std::abs(sheets_[k].at(x)) <= kOn;
  }

  /// The point where all three meet.
  [[nodiscard]] bool apex(Vec3& x) const {
    x = {};
    for (int step = 0; step < kSteps; ++step) {
      std::array<Vec3, 3> n;
      std::array<double, 3> c{};
      for (std::size_t k = 0; k < 3; ++k) {
        n[k] = sheets_[k].normal_at(x);
        c[k] = dot(n[k], x) - sheets_[k].at(x);
      }
      const double volume = dot(n[0], cross(n[1], n[2]));
      if (std::abs(volume) < 0.1) return false;
      x = (1 / volume) * (c[0] * cross(n[1], n[2]) + c[1] * cross(n[2], n[0]) + c[2] * cross(n[0], n[1]));
    }
    return std::abs(sheets_[0].at(x)) <= kOn && std::abs(sheets_[1].at(x)) <= kOn && std::abs(sheets_[2].at(x)) <= kOn;
  }

 private:
  const std::array<Sheet, 3>& sheets_;
  std::size_t count_;
  Combination c_;
};

double largest(const Vec3& v) {
  return std::max({std::abs(v[0]), std::abs(v[1]), std::abs(v[2])});
}

/// Points of the surface near the corner, and the sheets that meet there.
struct Candidate {
  Vec3 at{};
  std::array<std::size_t, 3> sheets{};
  std::size_t count = 0;
};

/// Points in the corner's own cube before others, corners before edges, near ones before far ones.
bool goes_before(const Candidate& a, const Candidate& b) {
  const auto rank = [](const Candidate& c) {
    return std::tuple(largest(c.at) > kOwnCube, -static_cast<int>(c.count), dot(c.at, c.at));
  };
  return rank(a) < rank(b);
}

/// The mean of the samples of other sheets, turned into the plane of one about the edge between them.
Vec3 unfolded(const Sheet& into, const Sheet& from, const Vec3& edge) {
  const Vec3 along = unit(cross(into.normal, from.normal));
  Vec3 out = cross(along, into.normal);  // in the plane, across the edge; away from the samples
  if (dot(out, into.mean - edge) > 0) out = -1.0 * out;
  const Vec3 w = from.mean - edge;
  const double shift = dot(w, along);
  const double across = std::sqrt(std::max(0.0, dot(w, w) - shift * shift));
  return edge + shift * along + across * out;
}

}  // namespace

double Sheet::at(const Vec3& x) const {
  const Vec3 y = x - point;
  const double along = dot(normal, y);
  const double bend = curvature * dot(y, y);
  const double root = 1 + curvature * (2 * along + bend);
  return (2 * along + bend) / (1 + std::sqrt(std::max(0.0, root)));
}

Vec3 Sheet::normal_at(const Vec3& x) const {
  return unit(normal + curvature * (x - point));
}

bool combine_sheets(const std::array<Sheet, 3>& sheets, std::size_t count, SheetsValue& out) {
  Surface surface(sheets, count);
  if (!surface.find_combination()) return false;
  std::array<Candidate, 7> found;
  std::size_t n = 0;
  for (std::size_t k = 0; k < count; ++k) {
    if (surface.holds(sheets[k].point)) found[n++] = {sheets[k].point, {k}, 1};
  }
  const std::size_t smooth = n;
  for (std::size_t j = 0; j < count; ++j) {
    for (std::size_t k = j + 1; k < count; ++k) {
      Vec3 x;
      if (surface.edge(j, k, x) && surface.holds(x)) found[n++] = {x, {j, k}, 2};
    }
  }
  if (Vec3 x; count == 3 && surface.apex(x)) found[n++] = {x, {0, 1, 2}, 3};
  if (n == 0) return false;
  const Candidate* nearest = found.data();
  const Candidate* crease = nullptr;
  for (std::size_t i = 0; i < n; ++i) {
    const Candidate& c = found[i];
    if (dot(c.at, c.at) < dot(nearest->at, nearest->at)) nearest = &c;
    if (i < smooth || largest(c.at) > kCreaseReach) continue;
    if (crease == nullptr || goes_before(c, *crease)) crease = &c;
  }
  const auto mean_normal = [&](const Candidate& c) {
    Vec3 sum{};
    for (std::size_t k = 0; k < c.count; ++k) sum = sum + sheets[c.sheets[k]].normal_at(c.at);
    return unit(sum);
  };
  const double side = surface.at({}) < 0 ? -1.0 : 1.0;
  const double d = norm(nearest->at);
  out.distance = side * d;
  out.nearest = nearest->sheets[0];
  for (std::size_t k = 1; k < nearest->count; ++k) {
    if (sheets[nearest->sheets[k]].share > sheets[out.nearest].share) out.nearest = nearest->sheets[k];
  }
  const bool on_sheet = nearest->count == 1;
  out.curvature = on_sheet ? sheets[out.nearest].curvature : 0;
  out.normal = on_sheet ? sheets[out.nearest].normal : (d > kOn ? (-side / d) * nearest->at : mean_normal(*nearest));
  Vec3 mean = sheets[out.nearest].share * sheets[out.nearest].mean;
  for (std::size_t k = 0; k < count; ++k) {
    if (k == out.nearest) continue;
    Vec3 edge;
    if (!surface.edge(out.nearest, k, edge)) edge = nearest->at;
    mean = mean + sheets[k].share * unfolded(sheets[out.nearest], sheets[k], edge);
  }
  out.lean = mean - nearest->at;
  out.creased = crease != nullptr;
  if (crease != nullptr) {
    out.crease = crease->at;
    out.crease_normal = mean_normal(*crease);
  }
  return true;
}

namespace {

constexpr int kPlaceBits = 14;
constexpr double kPlaceSteps = 8191 / kCreaseReach;  // a cell
constexpr int kTurnBits = 10;
constexpr double kTurnSteps = 511;

std::uint64_t packed_bits(double value, double steps, int bits) {
  const double most = static_cast<double>((std::int64_t{1} << (bits - 1)) - 1);
  const auto step = static_cast<std::int64_t>(std::lrint(std::clamp(value * steps, -most, most)));
  return static_cast<std::uint64_t>(step) & ((std::uint64_t{1} << bits) - 1);
}

double unpacked_bits(std::uint64_t from, int bits, double steps) {
  const auto up = static_cast<std::int64_t>(from << (64 - bits));
  return static_cast<double>(up >> (64 - bits)) / steps;
}

}  // namespace

std::array<float, 2> packed_crease(const Vec3& place, const Vec3& normal) {
  std::uint64_t bits = 1;  // there is one
  for (const double c : place) bits = (bits << kPlaceBits) | packed_bits(c, kPlaceSteps, kPlaceBits);
  // Octahedral coordinates: the lower half is folded over the upper one.
  const double sum = std::abs(normal[0]) + std::abs(normal[1]) + std::abs(normal[2]);
  std::array<double, 2> turn{normal[0] / sum, normal[1] / sum};
  if (normal[2] < 0) {
    turn = {std::copysign(1 - std::abs(normal[1]) / sum, normal[0]),
            std::copysign(1 - std::abs(normal[0]) / sum, normal[1])};
  }
  for (const double c : turn) bits = (bits << kTurnBits) | packed_bits(c, kTurnSteps, kTurnBits);
  return {std::bit_cast<float>(static_cast<std::uint32_t>(bits >> 32)),
          std::bit_cast<float>(static_cast<std::uint32_t>(bits))};
}

bool unpacked_crease(const float* packed, Vec3& place, Vec3& normal) {
  std::uint64_t bits =
      (std::uint64_t{std::bit_cast<std::uint32_t>(packed[0])} << 32) | std::bit_cast<std::uint32_t>(packed[1]);
  if (bits == 0) return false;
  const double v = unpacked_bits(bits, kTurnBits, kTurnSteps);
  bits >>= kTurnBits;
  const double u = unpacked_bits(bits, kTurnBits, kTurnSteps);
  bits >>= kTurnBits;
  for (std::size_t k = 3; k-- > 0; bits >>= kPlaceBits) place[k] = unpacked_bits(bits, kPlaceBits, kPlaceSteps);
  const double up = 1 - std::abs(u) - std::abs(v);
  normal =
      up >= 0 ? unit({u, v, up}) : unit({std::copysign(1 - std::abs(v), u), std::copysign(1 - std::abs(u), v), up});
  return true;
}

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

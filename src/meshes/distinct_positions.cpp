#include "meshes/distinct_positions.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <tuple>
#include <type_traits>
#include <utility>

#include "base/hashing.h"

namespace lamina {
namespace {

/// The bits of a coordinate; 0 and -0 are one position.
template <class T>
std::uint64_t bits_of(double c) {
  using Bits = std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>;
  return std::bit_cast<Bits>(static_cast<T>(c) + T{0});
}

template <class T>
std::uint64_t hash_of(double x, double y, double z) {
  std::uint64_t h = scrambled(bits_of<T>(x) + 0x9E3779B97F4A7C15U);
  h = scrambled(h ^ bits_of<T>(y));
  return scrambled(h ^ bits_of<T>(z));
}

/// `c` as a T, so many steps further on, each the spacing of numbers at `largest`.
template <class T>
double stepped(double c, double largest, int steps) {
  const T at = std::abs(static_cast<T>(largest));
  const T spacing =
      std::max(std::nextafter(at, std::numeric_limits<T>::infinity()) - at, std::numeric_limits<T>::min());
  return static_cast<double>(static_cast<T>(static_cast<T>(c) + static_cast<T>(steps) * spacing));
}

}  // namespace

void DistinctPositions::Set::clear(std::size_t expected) {
  seats_.assign(std::bit_ceil(std::max<std::size_t>(16, 2 * expected)), 0);
  size_ = 0;
}

std::size_t DistinctPositions::Set::seat_of(std::uint64_t value) const {
  const std::size_t mask = seats_.size() - 1;
  std::size_t seat = value & mask;
  while (seats_[seat] != 0 && seats_[seat] != value) seat = (seat + 1) & mask;
  return seat;
}

bool DistinctPositions::Set::contains(std::uint64_t value) const {
  return !seats_.empty() && seats_[seat_of(value)] != 0;
}

bool DistinctPositions::Set::insert(std::uint64_t value) {
  if (2 * (size_ + 1) > seats_.size()) {
    const std::vector<std::uint64_t> old = std::move(seats_);
    clear(std::max<std::size_t>(8, old.size()));
    for (const std::uint64_t v : old) {
      if (v != 0) insert(v);
    }
  }
  const std::size_t seat = seat_of(value);
  if (seats_[seat] != 0) return false;
  seats_[seat] = value;
  ++size_;
  return true;
}

std::uint64_t DistinctPositions::fingerprint(double x, double y, double z) const {
  const std::uint64_t h = double_ ? hash_of<double>(x, y, z) : hash_of<float>(x, y, z);
  return h == 0 ? 1 : h;
}

/// Along the axis that its normal is nearest to: off the surface, so that no triangle of it folds.
void DistinctPositions::move(VertexBatch& v, std::size_t i, int steps) const {
  const std::array<float, 3> normal{v.nx[i], v.ny[i], v.nz[i]};
  std::size_t axis = 0;
  for (std::size_t k = 1; k < 3; ++k) {
    if (std::abs(normal[k]) > std::abs(normal[axis])) axis = k;
  }
  double& c = axis == 0 ? v.x[i] : axis == 1 ? v.y[i] : v.z[i];
  const double largest = std::max({std::abs(v.x[i]), std::abs(v.y[i]), std::abs(v.z[i])});
  if (normal[axis] < 0) steps = -steps;
  c = double_ ? stepped<double>(c, largest, steps) : stepped<float>(c, largest, steps);
}

void DistinctPositions::separate(VertexBatch& v) {
  here_.clear(v.size());
  late_.clear();
  // Fingerprints of the next vertices: their seats are asked for as soon as they are known.
  constexpr std::size_t kAhead = 16;
  std::array<std::uint64_t, kAhead> prints{};
  for (std::size_t next = 0; next < v.size() + kAhead; ++next) {
    std::uint64_t& print = prints[next % kAhead];
    if (const std::size_t i = next - kAhead; next >= kAhead) {
      const bool first = here_.insert(print);
      if (!first || below_.contains(print)) late_.push_back(i);
    }
    if (next >= v.size()) continue;
    print = fingerprint(v.x[next], v.y[next], v.z[next]);
    here_.ask_for(print);
    below_.ask_for(print);
  }
  Set moved;
  for (const std::size_t i : late_) {
    const std::array<double, 3> from{v.x[i], v.y[i], v.z[i]};
    for (int steps = 1;; ++steps) {
      std::tie(v.x[i], v.y[i], v.z[i]) = std::tie(from[0], from[1], from[2]);
      move(v, i, steps);
      const std::uint64_t print = fingerprint(v.x[i], v.y[i], v.z[i]);
      if (!below_.contains(print) && !here_.contains(print) && moved.insert(print)) break;
    }
  }
  std::swap(below_, here_);
}

}  // namespace lamina

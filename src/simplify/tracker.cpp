#include "simplify/tracker.h"

#include <emmintrin.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "measure/triangle_bvh.h"

namespace lamina::simplify {
namespace {

using namespace meshes;

constexpr float kTightened = 0.8F;
constexpr double kUsed = 0.995;  ///< of the bound, by vertices: between them it is a little farther

float least_of(__m128 values) {
  alignas(16) std::array<float, 4> out;
  _mm_store_ps(out.data(), values);
  return std::min(std::min(out[0], out[1]), std::min(out[2], out[3]));
}

}  // namespace

Tracker::Tracker(const OldMesh& old)
    : old_(old),
      slack_(old.positions.size(), static_cast<float>(kUsed * old.bound)),
      homes_(old.positions.size(), kEnd),
      head_(old.triangles.size(), kEnd),
      next_(old.positions.size(), kEnd),
      slot_(old.positions.size()) {
  for (std::uint32_t i = 0; i < old.triangles.size(); ++i) {
    for (const std::uint32_t v : old.triangles[i]) {
      slack_[v] = std::min(slack_[v], static_cast<float>(kUsed * old.bound) - old.errors[i].out);
      if (homes_[v] == kEnd) put_home(v, i);
    }
  }
}

void Tracker::put_home(std::uint32_t vertex, std::uint32_t triangle) {
  homes_[vertex] = triangle;
  next_[vertex] = head_[triangle];
  head_[triangle] = vertex;
}

bool Tracker::allows(const Stars& stars, std::span<const Vec3> positions, std::uint32_t u, std::uint32_t v,
                     const Vec3& to) {
  gather(stars, u, v);
  make_fans(stars, positions, u, v, to);
  chosen_.resize(points_.size());
  seen_.resize(points_.size() * fans_.size());
  double least2 = std::numeric_limits<double>::infinity();
  std::uint32_t nearest = kEnd;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Vec3 at = old_.positions[points_[i]] - to;
    const double d2 = dot(at, at);
    if (d2 < least2) {
      least2 = d2;
      nearest = points_[i];
    }
    look(i, to_float(at));
    if (!find_home(i) && !find_home_exactly(i, at)) return false;
  }
  if (nearest == kEnd || !crossings_near(to)) return false;
  if (near_old(to, nearest)) return true;
  return std::any_of(points_.begin(), points_.end(), [&](std::uint32_t vertex) {
    const Vec3 at = old_.positions[vertex] - to;
    return dot(at, at) < 4 * least2 && near_old(to, vertex);
  });
}

void Tracker::gather(const Stars& stars, std::uint32_t u, std::uint32_t v) {
  star_.clear();
  after_.clear();
  points_.clear();
  for (const std::uint32_t vertex : {u, v}) {
    for (const std::uint32_t triangle : stars.around(vertex)) {
      const bool both = names(stars.triangles()[triangle], vertex == u ? v : u);
      if (both && vertex == v) continue;
      star_.push_back(triangle);
      if (!both) after_.push_back(triangle);
      for (std::uint32_t p = head_[triangle]; p != kEnd; p = next_[p]) points_.push_back(p);
    }
  }
}

void Tracker::make_fans(const Stars& stars, std::span<const Vec3> positions, std::uint32_t u, std::uint32_t v,
                        const Vec3& to) {
  fans_.resize((after_.size() + kLanes - 1) / kLanes);
  corners_.clear();
  for (std::size_t i = 0; i < kLanes * fans_.size(); ++i) {
    const std::size_t which = std::min(i, after_.size() - 1);  // the last one fills what is left
    const Triangle& t = stars.triangles()[after_[which]];
    const std::size_t k = corner_of(t, names(t, u) ? u : v);
    const Vec3 p = positions[t[(k + 1) % 3]] - to, q = positions[t[(k + 2) % 3]] - to;
    if (i < after_.size()) corners_.push_back({Vec3{}, p, q});
    const Vec3 n = unit(cross(p, q)), first = cross(n, p), second = cross(q, n), far = unit(cross(n, q - p));
    Fan& fan = fans_[i / kLanes];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      fan.own[axis][i % kLanes] = static_cast<float>(n[axis]);
      fan.first[axis][i % kLanes] = static_cast<float>(first[axis]);
      fan.second[axis][i % kLanes] = static_cast<float>(second[axis]);
      fan.far[axis][i % kLanes] = static_cast<float>(far[axis]);
    }
    fan.far_offset[i % kLanes] = -static_cast<float>(dot(far, p));
  }
}

/// The nearest of the triangles that it lies over or under, or beyond the side opposite the new vertex. False where
/// this is too far, or none.
bool Tracker::find_home(std::size_t point) {
  const __m128 zero = _mm_setzero_ps(), infinite = _mm_set1_ps(std::numeric_limits<float>::infinity());
  float best = slack_[points_[point]];
  if (best <= 0) return false;
  best *= best;
  bool found = false;
  for (std::size_t f = 0; f < fans_.size(); ++f) {
    const Seen& seen = seen_[point * fans_.size() + f];
    const __m128 height = _mm_load_ps(seen.height.data());
    const __m128 beyond = _mm_min_ps(_mm_load_ps(seen.far.data()), zero);
    const __m128 over = _mm_and_ps(_mm_cmpge_ps(_mm_load_ps(seen.first.data()), zero),
                                   _mm_cmpge_ps(_mm_load_ps(seen.second.data()), zero));
    const __m128 distance2 = _mm_add_ps(_mm_mul_ps(height, height), _mm_mul_ps(beyond, beyond));
    const __m128 counted = _mm_or_ps(_mm_and_ps(over, distance2), _mm_andnot_ps(over, infinite));
    if (_mm_movemask_ps(_mm_cmplt_ps(counted, _mm_set1_ps(best))) == 0) continue;
    const float least = least_of(counted);
    const auto lane = static_cast<unsigned>(_mm_movemask_ps(_mm_cmpeq_ps(counted, _mm_set1_ps(least))));
    const std::size_t which = kLanes * f + static_cast<std::size_t>(std::countr_zero(lane));
    chosen_[point] = after_[std::min(which, after_.size() - 1)];
    best = least;
    found = true;
  }
  return found;
}

/// Where sides of old triangles cross those of new ones: between two old vertices with different homes.
bool Tracker::crossings_near(const Vec3& to) {
  const std::size_t inside = points_.size();
  for (std::uint32_t i = 0; i < inside; ++i) slot_[points_[i]] = i;
  for (std::uint32_t i = 0; i < inside; ++i) {
    const std::uint32_t vertex = points_[i];
    for (const std::uint32_t other : old_.neighbours(vertex)) {
      std::uint32_t j = slot_[other];
      if (j >= points_.size() || points_[j] != other) {
        j = slot_[other] = static_cast<std::uint32_t>(points_.size());
        points_.push_back(other);
        seen_.resize(points_.size() * fans_.size());
        look(j, to_float(old_.positions[other] - to));
      }
      if (j < inside && (j < i || chosen_[i] == chosen_[j])) continue;
      if (!crossing_near(i, j, std::min(slack_[vertex], slack_[other]))) return false;
    }
  }
  points_.resize(inside);
  return true;
}

bool Tracker::crossing_near(std::size_t from, std::size_t to, float slack) const {
  for (std::size_t f = 0; f < fans_.size(); ++f) {
    const Seen &a = seen_[from * fans_.size() + f], &b = seen_[to * fans_.size() + f];
    const __m128 first = _mm_load_ps(a.first.data()), first_to = _mm_load_ps(b.first.data());
    const auto apart = static_cast<unsigned>(_mm_movemask_ps(_mm_xor_ps(first, first_to)));
    for (unsigned left = apart; left != 0; left &= left - 1) {
      const auto lane = static_cast<std::size_t>(std::countr_zero(left));
      const float along = a.first[lane] / (a.first[lane] - b.first[lane]);
      const auto there = [&](const std::array<float, kLanes>& x, const std::array<float, kLanes>& y) {
        return x[lane] + along * (y[lane] - x[lane]);
      };
      if (there(a.second, b.second) < 0 || there(a.far, b.far) < 0) continue;
      if (std::abs(there(a.height, b.height)) > slack) return false;
    }
  }
  return true;
}

/// Where a point lies beside the planes of the fans.
void Tracker::look(std::size_t point, const std::array<float, 3>& at) {
  const __m128 x = _mm_set1_ps(at[0]), y = _mm_set1_ps(at[1]), z = _mm_set1_ps(at[2]);
  const auto times = [&](const std::array<std::array<float, kLanes>, 3>& plane) {
    return _mm_add_ps(
        _mm_add_ps(_mm_mul_ps(_mm_load_ps(plane[0].data()), x), _mm_mul_ps(_mm_load_ps(plane[1].data()), y)),
        _mm_mul_ps(_mm_load_ps(plane[2].data()), z));
  };
  for (std::size_t f = 0; f < fans_.size(); ++f) {
    const Fan& fan = fans_[f];
    Seen& seen = seen_[point * fans_.size() + f];
    _mm_store_ps(seen.height.data(), times(fan.own));
    _mm_store_ps(seen.first.data(), times(fan.first));
    _mm_store_ps(seen.second.data(), times(fan.second));
    _mm_store_ps(seen.far.data(), _mm_add_ps(times(fan.far), _mm_load_ps(fan.far_offset.data())));
  }
}

/// `at`: from the new vertex.
bool Tracker::find_home_exactly(std::size_t point, const Vec3& at) {
  const auto slack = static_cast<double>(slack_[points_[point]]);
  double least2 = slack * slack;
  bool found = false;
  for (std::size_t i = 0; i < after_.size(); ++i) {
    const auto& [a, b, c] = corners_[i];
    const double d2 = measure::squared_distance_to_triangle(at, a, b, c);
    if (slack < 0 || d2 > least2) continue;
    least2 = d2;
    chosen_[point] = after_[i];
    found = true;
  }
  return found;
}

/// Is the place near an old triangle at this vertex?
bool Tracker::near_old(const Vec3& at, std::uint32_t vertex) const {
  const auto around = old_.around(vertex);
  return std::any_of(around.begin(), around.end(), [&](std::uint32_t triangle) {
    const Triangle& t = old_.triangles[triangle];
    const double most = kUsed * old_.bound - static_cast<double>(old_.errors[triangle].back);
    return most >= 0 && measure::squared_distance_to_triangle(at, old_.positions[t[0]], old_.positions[t[1]],
                                                              old_.positions[t[2]]) <= most * most;
  });
}

void Tracker::tighten(std::uint32_t triangle) {
  for (std::uint32_t p = head_[triangle]; p != kEnd; p = next_[p]) slack_[p] *= kTightened;
}

void Tracker::accept() {
  for (const std::uint32_t triangle : star_) head_[triangle] = kEnd;
  for (std::size_t i = 0; i < points_.size(); ++i) put_home(points_[i], chosen_[i]);
}

void Tracker::settle(const Stars& stars, std::span<const Vec3> positions, std::span<const std::uint32_t> triangles) {
  points_.clear();
  for (const std::uint32_t triangle : triangles) {
    for (std::uint32_t p = head_[triangle]; p != kEnd; p = next_[p]) points_.push_back(p);
    head_[triangle] = kEnd;
  }
  for (const std::uint32_t point : points_) {
    double least2 = std::numeric_limits<double>::infinity();
    std::uint32_t home = kEnd;
    for (const std::uint32_t triangle : triangles) {
      if (!stars.alive(triangle)) continue;
      const Triangle& t = stars.triangles()[triangle];
      const double d2 = measure::squared_distance_to_triangle(old_.positions[point], positions[t[0]], positions[t[1]],
                                                              positions[t[2]]);
      if (home != kEnd && d2 >= least2) continue;
      least2 = d2;
      home = triangle;
    }
    put_home(point, home);
  }
}

}  // namespace lamina::simplify

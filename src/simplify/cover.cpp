#include "simplify/cover.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace lamina::simplify {
namespace {

using namespace meshes;

constexpr double kFar = std::numeric_limits<double>::infinity();
constexpr double kTouching = 1e-9;   ///< of a side: a corner on its line is on no side of it
constexpr double kGoodEnough = 0.7;  ///< of the bound: no nearer facet is looked for

}  // namespace

Facet make_facet(const Vec3& a, const Vec3& b, const Vec3& c) {
  Facet f;
  f.corners = {a, b, c};
  f.normal = unit(cross(b - a, c - a));
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3 side = f.corners[(k + 1) % 3] - f.corners[k];
    f.length[k] = norm(side);
    f.along[k] = unit(side);
    f.outward[k] = cross(f.along[k], f.normal);
  }
  return f;
}

bool Cover::prove(const std::array<Vec3, 3>& triangle, double error, std::span<const Facet> facets, int cuts) {
  slack_ = bound_ - error;
  error_ = 0;
  used_.clear();
  open_.clear();
  open_.emplace_back();
  std::copy(triangle.begin(), triangle.end(), open_.back().at.begin());
  open_.back().size = 3;
  while (!open_.empty()) {
    Polygon polygon = open_.back();
    open_.pop_back();
    if (!find_near(polygon.at[0], facets)) return false;
    if (take(polygon)) continue;
    Cut cut{};
    bool found = choose_cut(polygon, cut);
    for (std::size_t first = 1; first < polygon.size && !found; ++first) {
      std::rotate(polygon.at.begin(), polygon.at.begin() + 1, polygon.at.begin() + polygon.size);
      if (!find_near(polygon.at[0], facets)) return false;
      found = choose_cut(polygon, cut);
    }
    if (!found || cuts-- <= 0 || !split(polygon, cut)) return false;
  }
  error_ += error;
  return true;
}

bool Cover::find_near(const Vec3& x, std::span<const Facet> facets) {
  near_.clear();
  for (const Facet& f : facets) {
    const double d = distance_within(x, f, slack_ - f.error);
    if (d != kFar) near_.push_back({&f, d});
  }
  return !near_.empty();
}

/// Is all of it near one facet? The one that is nearest, or near enough.
bool Cover::take(const Polygon& polygon) {
  const Facet* best = nullptr;
  double least = kFar;
  for (const auto& [f, first] : near_) {
    double error = first + f->error;
    std::size_t near = 1;
    for (; near < polygon.size; ++near) {
      const double d = distance_within(polygon.at[near], *f, std::min(slack_, least) - f->error);
      if (d == kFar) break;
      error = std::max(error, d + f->error);
    }
    if (near < polygon.size || error >= least) continue;
    best = f;
    least = error;
    if (error <= kGoodEnough * bound_) break;
  }
  if (best == nullptr) return false;
  error_ = std::max(error_, least);
  if (std::find(used_.begin(), used_.end(), best->id) == used_.end()) used_.push_back(best->id);
  return true;
}

/// Along the side of a facet that is near the first corner, between that and one that it is not near.
bool Cover::choose_cut(const Polygon& polygon, Cut& cut) const {
  std::size_t most_near = 0;
  for (const auto& [f, first] : near_) {
    std::size_t near = 1, far = 0;
    for (std::size_t i = 1; i < polygon.size; ++i) {
      const bool is_near = distance_within(polygon.at[i], *f, slack_ - f->error) != kFar;
      near += is_near ? 1 : 0;
      if (!is_near && far == 0) far = i;
    }
    if (near <= most_near || far == 0) continue;
    double farthest = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double touching = kTouching * f->length[k];
      const double beyond = dot(f->outward[k], polygon.at[far] - f->corners[k]);
      if (beyond <= std::max(farthest, touching) || dot(f->outward[k], polygon.at[0] - f->corners[k]) > -touching)
        continue;
      farthest = beyond;
      cut = {f->outward[k], dot(f->outward[k], f->corners[k])};
      most_near = near;
    }
  }
  return most_near > 0;
}

bool Cover::split(const Polygon& polygon, const Cut& cut) {
  Polygon below, above;
  const auto add = [](Polygon& p, const Vec3& x) {
    if (p.size < kCorners) p.at[p.size] = x;
    ++p.size;
  };
  for (std::size_t i = 0; i < polygon.size; ++i) {
    const Vec3 &x = polygon.at[i], &y = polygon.at[(i + 1) % polygon.size];
    const double dx = dot(cut.normal, x) - cut.offset, dy = dot(cut.normal, y) - cut.offset;
    if (dx <= 0) add(below, x);
    if (dx >= 0) add(above, x);
    if ((dx < 0 && dy > 0) || (dx > 0 && dy < 0)) {
      const Vec3 between = x + (dx / (dx - dy)) * (y - x);
      add(below, between);
      add(above, between);
    }
  }
  if (below.size > kCorners || above.size > kCorners) return false;
  if (below.size == polygon.size && above.size < 3) return false;
  if (above.size == polygon.size && below.size < 3) return false;
  if (below.size >= 3) open_.push_back(below);
  if (above.size >= 3) open_.push_back(above);
  return true;
}

}  // namespace lamina::simplify

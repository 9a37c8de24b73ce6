#include "boundary/rim_fairing.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

#include "base/hashing.h"

namespace lamina {
namespace {

/// What a vertex sums up over its triangles: in each one neighbour comes next and one before, and those of a closed fan
/// cancel. Of an open one there remain the first, a, and the last, b: as a - b, as a^2 - b^2, and as a hash that tells
/// whether these two are all that remain.
struct FanSums {
  std::uint64_t difference = 0, squares = 0, hash = 0;

  void add(std::int64_t next, std::int64_t before) {
    const auto n = static_cast<std::uint64_t>(next);
    const auto b = static_cast<std::uint64_t>(before);
    difference += n - b;
    squares += n * n - b * b;
    hash += scrambled(n) - scrambled(b);
  }
  [[nodiscard]] bool open() const { return hash != 0; }
  /// False where it is no single fan.
  [[nodiscard]] bool ends(std::int64_t& a, std::int64_t& b) const {
    const auto minus = static_cast<std::int64_t>(difference);
    const auto product = static_cast<std::int64_t>(squares);
    if (minus == 0 || product % minus != 0) return false;
    const std::int64_t plus = product / minus;
    if ((plus + minus) % 2 != 0) return false;
    a = (plus + minus) / 2;
    b = (plus - minus) / 2;
    return scrambled(static_cast<std::uint64_t>(a)) - scrambled(static_cast<std::uint64_t>(b)) == hash;
  }
};

Eigen::Vector3d vector_of(const std::array<double, 3>& p) {
  return {p[0], p[1], p[2]};
}

}  // namespace

void RimFairer::push(MeshSlab slab) {
  Held& held = held_.emplace_back();
  held.first = pushed_;
  pushed_ += static_cast<std::uint32_t>(slab.vertices.size());
  held.mesh = std::move(slab);
  if (held_.size() > 1) find_rim(held_[held_.size() - 2], &held);
  go_on();
}

void RimFairer::finish() {
  finished_ = true;
  if (!held_.empty()) find_rim(held_.back(), nullptr);
  go_on();
}

bool RimFairer::pop(MeshSlab& out) {
  const std::size_t at = below_ ? 1 : 0;
  if (held_.size() <= at || held_[at].steps < kFairingSteps) return false;
  Held& here = held_[at];
  out = std::move(here.mesh);
  VertexBatch& vertices = out.vertices;
  // The slab above looks down at this one as long as it moves; where what is on its rim is, it knows itself.
  VertexBatch& left = here.mesh.vertices;
  left = {};
  if (held_.size() > at + 1 && !held_[at + 1].rim.empty()) {
    left.x = vertices.x;
    left.y = vertices.y;
    left.z = vertices.z;
  }
  for (const RimVertex& v : here.rim) {
    vertices.x[v.vertex] = v.at.back()[0];
    vertices.y[v.vertex] = v.at.back()[1];
    vertices.z[v.vertex] = v.at.back()[2];
  }
  if (below_) held_.pop_front();
  below_ = true;
  return true;
}

/// A vertex has triangles in its own slab and in the one above.
void RimFairer::find_rim(Held& here, const Held* above) {
  const auto& vertices = here.mesh.vertices;
  const auto first = std::int64_t{here.first};
  const std::uint32_t end = here.first + static_cast<std::uint32_t>(vertices.size());
  const auto each_corner = [&](const auto& use) {
    for_corners(here.mesh.triangles, here.first, end, use);
    if (above != nullptr) for_corners(above->mesh.triangles, here.first, end, use);
  };
  std::vector<FanSums> sums(vertices.size());
  each_corner(
      [&](std::uint32_t v, std::uint32_t next, std::uint32_t before) { sums[v].add(next - first, before - first); });
  here.steps = 0;
  std::int64_t a = 0;
  std::int64_t b = 0;
  for (std::uint32_t i = 0; i < sums.size(); ++i) {
    if (!sums[i].open() || !sums[i].ends(a, b)) continue;
    RimVertex& v = here.rim.emplace_back();
    v.vertex = i;
    v.beside = {static_cast<std::uint32_t>(a + first), static_cast<std::uint32_t>(b + first)};
    v.at[0] = {vertices.x[i], vertices.y[i], vertices.z[i]};
  }
  if (here.rim.empty()) return;
  constexpr std::uint32_t kInside = ~0U;
  std::vector<std::uint32_t> slot(vertices.size(), kInside);
  for (std::uint32_t r = 0; r < here.rim.size(); ++r) slot[here.rim[r].vertex] = r;
  each_corner([&](std::uint32_t v, std::uint32_t next, std::uint32_t before) {
    if (slot[v] != kInside) here.rim[slot[v]].fan.push_back({next, before});
  });
  for (RimVertex& v : here.rim) std::sort(v.fan.begin(), v.fan.end());  // sums must not depend on how they came
}

/// A slab's vertices take a step when those beside, in the slabs around, have taken the one before.
void RimFairer::go_on() {
  for (int number = 1; number <= kFairingSteps; ++number) {
    for (std::size_t i = 0; i < held_.size(); ++i) {
      // Before the first step vertices are where they came, whether the rim is known or not.
      const auto known = [&](const Held& beside) { return number == 1 || beside.steps >= number - 1; };
      const bool below = i == 0 || known(held_[i - 1]);
      const bool above = i + 1 < held_.size() ? known(held_[i + 1]) : finished_;
      if (held_[i].steps == number - 1 && below && above) step(held_[i], static_cast<std::size_t>(number));
    }
  }
}

RimFairer::Point RimFairer::position(std::uint32_t v, std::size_t steps) const {
  const auto after = std::partition_point(held_.begin(), held_.end(), [v](const Held& h) { return h.first <= v; });
  const Held& held = *(after - 1);
  const std::uint32_t i = v - held.first;
  const auto found = std::lower_bound(held.rim.begin(), held.rim.end(), i,
                                      [](const RimVertex& r, std::uint32_t vertex) { return r.vertex < vertex; });
  if (found != held.rim.end() && found->vertex == i) return found->at[steps];
  const VertexBatch& vertices = held.mesh.vertices;
  return {vertices.x[i], vertices.y[i], vertices.z[i]};
}

RimFairer::Fan RimFairer::fan_of(const RimVertex& v, std::size_t steps) const {
  const Eigen::Vector3d at = vector_of(v.at[steps]);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double least = HUGE_VAL;
  for (const auto& [next, before] : v.fan) {
    const Eigen::Vector3d p = vector_of(position(next, steps)) - at;
    const Eigen::Vector3d q = vector_of(position(before, steps)) - at;
    const Eigen::Vector3d across = p.cross(q);
    const double longest = std::sqrt(std::max({p.squaredNorm(), q.squaredNorm(), (p - q).squaredNorm()}));
    least = std::min(least, longest > 0 ? across.norm() / longest : 0);
    sum += across;
  }
  sum.normalize();
  return {{sum.x(), sum.y(), sum.z()}, least};
}

void RimFairer::step(Held& here, std::size_t number) {
  for (RimVertex& v : here.rim) {
    const Eigen::Vector3d at = vector_of(v.at[number - 1]);
    const Fan fan = fan_of(v, number - 1);
    // Not the fit's, which turns with the noise, more so where samples end: a rim would leave the surface.
    const Eigen::Vector3d normal = vector_of(fan.normal);
    const Eigen::Vector3d middle =
        0.5 * (vector_of(position(v.beside[0], number - 1)) + vector_of(position(v.beside[1], number - 1)));
    Eigen::Vector3d move = 0.5 * (middle - at);
    move -= move.dot(normal) * normal;
    const double most = kMostFairing * fan.least_height;
    if (const double length = move.norm(); length > most) move *= most / length;
    const Eigen::Vector3d to = at + move;
    v.at[number] = {to.x(), to.y(), to.z()};
  }
  here.steps = static_cast<int>(number);
}

}  // namespace lamina

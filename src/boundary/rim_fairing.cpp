#include "boundary/rim_fairing.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

namespace lamina {
namespace {

/// The first and the last neighbour of an open fan with this hash, from the other two vertices of its triangles: in
/// each one comes next and one before, and those in the middle cancel. False where it is no single fan.
bool ends_of(const std::vector<std::array<std::uint32_t, 2>>& fan, std::uint64_t hash,
             std::array<std::uint32_t, 2>& ends) {
  // What remains of a - b and of a^2 - b^2.
  std::uint64_t difference = 0, squares = 0;
  const std::uint64_t origin = fan.front()[0];
  for (const auto& [next, before] : fan) {
    const std::uint64_t n = next - origin, b = before - origin;
    difference += n - b;
    squares += n * n - b * b;
  }
  const auto minus = static_cast<std::int64_t>(difference);
  const auto product = static_cast<std::int64_t>(squares);
  if (minus == 0 || product % minus != 0) return false;
  const std::int64_t plus = product / minus;
  if ((plus + minus) % 2 != 0) return false;
  ends = {static_cast<std::uint32_t>((plus + minus) / 2 + static_cast<std::int64_t>(origin)),
          static_cast<std::uint32_t>((plus - minus) / 2 + static_cast<std::int64_t>(origin))};
  return fan_hash(ends[0], ends[1]) == hash;
}

Eigen::Vector3d vector_of(const std::array<double, 3>& p) {
  return {p[0], p[1], p[2]};
}

}  // namespace

void RimFairer::push(MeshSlab slab) {
  Held& held = held_.emplace_back();
  held.first = pushed_;
  pushed_ += static_cast<std::uint32_t>(slab.vertices.size());
  held.mesh = std::move(slab);
  held.fans.assign(held.mesh.vertices.size(), 0);
  FanHashes none;
  Held* const below = held_.size() > 1 ? &held_[held_.size() - 2] : nullptr;
  add_fans(held.mesh, held.first, held.fans, below != nullptr ? below->fans : none);
  if (below != nullptr) find_rim(*below, &held);
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
  const FanHashes fans = std::exchange(here.fans, {});
  here.steps = 0;
  for (std::uint32_t i = 0; i < fans.size(); ++i) {
    if (fans[i] == 0) continue;
    RimVertex& v = here.rim.emplace_back();
    v.vertex = i;
    v.at[0] = {vertices.x[i], vertices.y[i], vertices.z[i]};
  }
  if (here.rim.empty()) return;
  constexpr std::uint32_t kInside = ~0U;
  std::vector<std::uint32_t> slot(vertices.size(), kInside);
  for (std::uint32_t r = 0; r < here.rim.size(); ++r) slot[here.rim[r].vertex] = r;
  const auto collect = [&](const MeshSlab& mesh) {
    for_corners(mesh.triangles, here.first, here.first + static_cast<std::uint32_t>(vertices.size()),
                [&](std::uint32_t v, std::uint32_t next, std::uint32_t before) {
                  if (slot[v] != kInside) here.rim[slot[v]].fan.push_back({next, before});
                });
  };
  collect(here.mesh);
  if (above != nullptr) collect(above->mesh);
  std::erase_if(here.rim, [&](RimVertex& v) { return !ends_of(v.fan, fans[v.vertex], v.beside); });
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

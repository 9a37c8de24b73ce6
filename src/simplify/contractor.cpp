#include "simplify/contractor.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "simplify/contraction.h"

namespace lamina::simplify {

using namespace meshes;

Contractor::Contractor(Piece piece)
    : piece_(std::move(piece)),
      stars_(std::move(piece_.triangles), piece_.positions.size()),
      size_(stars_.triangles().size()),
      version_(piece_.positions.size()) {
  if (piece_.bound > 0) tracker_.emplace(piece_.positions, stars_.triangles(), std::move(piece_.errors), piece_.bound);
  later_.reserve(2 * size_);
  for (std::uint32_t u = 0; u < version_.size(); ++u) {
    if (piece_.fixed[u] != 0) continue;
    stars_.neighbours(u, near_);
    for (const std::uint32_t v : near_) {
      if (u < v) offer(u, v);
    }
  }
}

Placed Contractor::place(std::uint32_t u, std::uint32_t v) const {
  Quadric sum = piece_.quadrics[u];
  sum += piece_.quadrics[v];
  const Placed placed = place_edge(sum, piece_.positions[u] - piece_.centre, piece_.positions[v] - piece_.centre);
  Vec3 at = placed.at + piece_.centre;
  if (piece_.floats) {
    for (double& c : at) {
      // Without volatile GCC 12 computes two coordinates at once and leaves out that they are rounded.
      const volatile float rounded = static_cast<float>(c);
      c = static_cast<double>(rounded);
    }
  }
  return {at, placed.cost};
}

void Contractor::offer(std::uint32_t u, std::uint32_t v) {
  if (piece_.fixed[v] != 0) return;
  if (u > v) std::swap(u, v);
  const Entry edge{static_cast<float>(place(u, v).cost), u, v, version_[u] + version_[v]};
  if (edge.cost > limit_) {
    later_.push_back(edge);
    least_later_ = std::min(least_later_, edge.cost);
    return;
  }
  heap_.push_back(edge);
  std::push_heap(heap_.begin(), heap_.end());
}

void Contractor::raise_limit(float limit) {
  if (limit <= limit_) return;
  limit_ = limit;
  least_later_ = std::numeric_limits<float>::infinity();
  std::size_t kept = 0;
  for (const Entry& e : later_) {
    if (stale(e)) continue;
    if (e.cost <= limit_) {
      heap_.push_back(e);
      continue;
    }
    least_later_ = std::min(least_later_, e.cost);
    later_[kept++] = e;
  }
  later_.resize(kept);
  std::make_heap(heap_.begin(), heap_.end());
}

void Contractor::drop_stale() {
  while (!heap_.empty() && stale(heap_.front())) {
    std::pop_heap(heap_.begin(), heap_.end());
    heap_.pop_back();
  }
}

float Contractor::next_cost() {
  drop_stale();
  return heap_.empty() ? least_later_ : heap_.front().cost;
}

std::uint64_t Contractor::run(float dearest, std::uint64_t keep) {
  const std::uint64_t before = size_;
  raise_limit(dearest);
  while (size_ > keep) {
    drop_stale();
    if (heap_.empty() || heap_.front().cost > dearest || std::isinf(heap_.front().cost)) break;
    const Entry e = heap_.front();
    std::pop_heap(heap_.begin(), heap_.end());
    heap_.pop_back();
    if (!stars_.contractible(e.u, e.v)) continue;
    const Placed to = place(e.u, e.v);
    if (!keeps_shape(stars_, piece_.positions, e.u, e.v, to.at) || (tracker_ && !stays_near(e.u, e.v, to))) continue;
    const double weight = piece_.quadrics[e.u].weight() + piece_.quadrics[e.v].weight();
    if (weight > 0) deviation2_ = std::max(deviation2_, to.cost / weight);
    size_ -= static_cast<std::uint64_t>(contract(e.u, e.v, to.at));
    if (tracker_) tracker_->accept();
  }
  return before - size_;
}

/// Within the bound? Where the root mean square of the planes' distances is far beyond it, nothing is proved any more.
bool Contractor::stays_near(std::uint32_t u, std::uint32_t v, const Placed& to) {
  const Vec3 edge = piece_.positions[v] - piece_.positions[u];
  const double of_noise = 16 * kNormalNoise * kNormalNoise * dot(edge, edge);  // counted in the cost, too
  const double weight = piece_.quadrics[u].weight() + piece_.quadrics[v].weight();
  if (to.cost > weight * (piece_.bound * piece_.bound + of_noise)) return false;
  return tracker_->allows(stars_, piece_.positions, u, v, to.at);
}

int Contractor::contract(std::uint32_t u, std::uint32_t v, const Vec3& to) {
  const double share = share_along(piece_.positions[u], piece_.positions[v], to);
  merges_.push_back({u, v, static_cast<float>(share)});
  piece_.positions[u] = to;
  piece_.quadrics[u] += piece_.quadrics[v];
  const int gone = stars_.contract(u, v);
  ++version_[u];
  stars_.neighbours(u, near_);
  for (const std::uint32_t w : near_) offer(u, w);
  return gone;
}

}  // namespace lamina::simplify

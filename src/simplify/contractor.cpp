#include "simplify/contractor.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace lamina::simplify {

using namespace meshes;

namespace {
constexpr int kAttempts = 20;  ///< to go on where contractions were taken back
/// Costs up to so many times what a run asks for are put in order at once: runs follow each other in small steps, and
/// each time anew all later edges are looked through.
constexpr float kLimitAhead = 4;
}  // namespace

Contractor::Contractor(Piece piece)
    : piece_(std::move(piece)),
      stars_(std::move(piece_.triangles), piece_.positions.size()),
      size_(stars_.triangles().size()),
      version_(piece_.positions.size()) {
  if (piece_.bound > 0) {
    old_.emplace(piece_.positions, stars_.triangles(), piece_.errors, piece_.bound);
    piece_.errors = {};
    tracker_.emplace(*old_);
    change_.assign(size_, kNone);
  }
  later_.reserve(2 * size_);
  for (std::uint32_t u = 0; u < version_.size(); ++u) {
    if (piece_.fixed[u] != 0) continue;
    stars_.neighbours(u, near_);
    for (const std::uint32_t v : near_) {
      if (u < v && !(tried(u) && tried(v))) offer(u, v);
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
  if ((piece_.fixed[u] | piece_.fixed[v]) != 0) return;
  if (u > v) std::swap(u, v);
  const double cost = place(u, v).cost;
  if (old_ && surely_far(u, v, cost)) return;
  const Entry edge{static_cast<float>(cost), u, v, version_[u] + version_[v]};
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
  limit_ = limit * kLimitAhead;
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
  const auto place_of = [&](std::uint32_t v) -> const Vec3& { return piece_.positions[v]; };
  while (size_ > keep) {
    drop_stale();
    if (heap_.empty() || heap_.front().cost > dearest || std::isinf(heap_.front().cost)) break;
    const Entry e = heap_.front();
    std::pop_heap(heap_.begin(), heap_.end());
    heap_.pop_back();
    if (!stars_.contractible(e.u, e.v)) continue;
    const Placed to = place(e.u, e.v);
    if (!keeps_shape(stars_, place_of, e.u, e.v, to.at) || (old_ && !stays_near(e.u, e.v, to))) continue;
    const double weight = piece_.quadrics[e.u].weight() + piece_.quadrics[e.v].weight();
    if (weight > 0) deviation2_ = std::max(deviation2_, to.cost / weight);
    size_ -= static_cast<std::uint64_t>(contract(e.u, e.v, to.at));
    if (old_) tracker_->accept(e.u, e.v);
  }
  return before - size_;
}

/// Is the root mean square of the planes' distances beyond the bound? Such edges are not even offered.
bool Contractor::surely_far(std::uint32_t u, std::uint32_t v, double cost) const {
  const Vec3 edge = piece_.positions[v] - piece_.positions[u];
  const double of_noise = 16 * kNormalNoise * kNormalNoise * dot(edge, edge);  // counted in the cost, too
  const double weight = piece_.quadrics[u].weight() + piece_.quadrics[v].weight();
  return cost > weight * (piece_.bound * piece_.bound + of_noise);
}

/// Within the bound, as it seems?
bool Contractor::stays_near(std::uint32_t u, std::uint32_t v, const Placed& to) {
  const double weight = piece_.quadrics[u].weight() + piece_.quadrics[v].weight();
  return tracker_->takes_on_trust(stars_, u, v, weight > 0 ? to.cost / weight : 0) ||
         tracker_->allows(stars_, piece_.positions, u, v, to.at);
}

int Contractor::contract(std::uint32_t u, std::uint32_t v, const Vec3& to) {
  const double share = share_along(piece_.positions[u], piece_.positions[v], to);
  if (old_) note(u, v);
  merges_.push_back({u, v, static_cast<float>(share)});
  piece_.positions[u] = to;
  piece_.quadrics[u] += piece_.quadrics[v];
  const int gone = stars_.contract(u, v);
  ++version_[u];
  stars_.neighbours(u, near_);
  for (const std::uint32_t w : near_) offer(u, w);
  return gone;
}

void Contractor::note(std::uint32_t u, std::uint32_t v) {
  steps_.push_back({u, v, piece_.positions[u], piece_.quadrics[u], stars_.before(u, v), earlier_.size()});
  const auto number = static_cast<std::uint32_t>(steps_.size() - 1);
  stars_.for_touched(steps_.back().before, [&](std::uint32_t triangle) {
    earlier_.push_back(change_[triangle]);
    change_[triangle] = number;
  });
}

void Contractor::prove() {
  if (!old_) return;
  if (!steps_.empty()) {
    keep_bound();
  } else {
    for (const OldTriangle& t : old_->triangles) errors_.push_back(t.errors);
  }
  std::erase_if(merges_, [](const Merge& merge) { return merge.u == kNone; });
  heap_ = {};
  later_ = {};
  old_.reset();
  tracker_.reset();
  steps_ = {};
  change_ = {};
  earlier_ = {};
}

void Contractor::keep_bound() {
  Proof proof(*old_, {stars_, piece_.positions, change_}, *tracker_);
  for (int attempt = 0;; ++attempt) {
    const std::vector<std::uint32_t>& failures = proof.find_failures();
    if (failures.empty()) break;
    for (const std::uint32_t triangle : failures) tracker_->tighten(triangle);
    std::vector<std::uint32_t> touched;
    for (const std::uint32_t triangle : failures) {
      if (stars_.alive(triangle) && change_[triangle] != kNone) take_back(change_[triangle], touched);
    }
    if (attempt < kAttempts) go_on(touched);
    proof.forget(touched);
  }
  errors_ = proof.errors();
}

/// Contractions of what has been taken back are tried again, and what they touch is added.
void Contractor::go_on(std::vector<std::uint32_t>& touched) {
  std::vector<std::uint32_t> vertices;
  for (const std::uint32_t triangle : touched) {
    if (!stars_.alive(triangle)) continue;
    for (const std::uint32_t v : stars_.triangles()[triangle]) vertices.push_back(v);
  }
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  for (const std::uint32_t v : vertices) ++version_[v];
  for (const std::uint32_t v : vertices) {
    stars_.neighbours(v, near_);
    for (const std::uint32_t w : near_) {
      if (v < w || !std::binary_search(vertices.begin(), vertices.end(), w)) offer(v, w);
    }
  }
  const std::size_t before = steps_.size();
  run(std::numeric_limits<float>::max(), 0);
  for (std::size_t step = before; step < steps_.size(); ++step)
    stars_.for_touched(steps_[step].before, [&](std::uint32_t triangle) { touched.push_back(triangle); });
}

/// And first those behind it that changed its triangles.
void Contractor::take_back(std::uint32_t step, std::vector<std::uint32_t>& touched) {
  const Step& s = steps_[step];
  std::vector<std::uint32_t> triangles;
  stars_.for_touched(s.before, [&](std::uint32_t triangle) { triangles.push_back(triangle); });
  for (const std::uint32_t triangle : triangles) {
    while (change_[triangle] != step) take_back(change_[triangle], touched);
  }
  size_ += static_cast<std::uint64_t>(stars_.revert(s.u, s.v, s.before));
  piece_.positions[s.u] = s.place;
  piece_.quadrics[s.u] = s.quadric;
  merges_[step].u = kNone;
  for (std::size_t i = triangles.size(); i-- > 0;) change_[triangles[i]] = earlier_[s.changes + i];
  tracker_->undo(s.u, s.v);
  for (const std::uint32_t triangle : triangles) tracker_->forget(triangle);
  touched.insert(touched.end(), triangles.begin(), triangles.end());
}

}  // namespace lamina::simplify

#include "simplify/stars.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace lamina::simplify {
namespace {

using namespace meshes;

constexpr float kLeastCosine = 0.2F;  ///< a triangle turns no farther at one contraction

constexpr std::size_t kLanes = 4;
using Lanes = float __attribute__((vector_size(4 * kLanes)));
using Triple = std::array<Lanes, 3>;

Triple less(const Triple& a, const Triple& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Lanes times(const Triple& a, const Triple& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Triple across(const Triple& a, const Triple& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// Four triangles p, q and one corner more, that moves from `from` to the origin. A triangle's quality goes by four
/// times its squared area over the square of the sum of its squared sides: 1/12 where it is equilateral, 0 where it has
/// no area.
bool keep(const Triple& from, const Triple& p, const Triple& q, float sliver2) {
  const Triple from_p = less(p, from), from_q = less(q, from), base = less(q, p);
  const Triple before = across(from_p, from_q), after = across(p, q);
  const Lanes along = times(before, after), was = times(before, before), is = times(after, after);
  const Lanes side = times(base, base);
  const Lanes was_sides = times(from_p, from_p) + times(from_q, from_q) + side;
  const Lanes is_sides = times(p, p) + times(q, q) + side;
  const auto same_side = (along > 0) & (along * along > kLeastCosine * kLeastCosine * was * is);
  const auto good = 12 * is >= sliver2 * is_sides * is_sides;
  const auto no_worse = is * was_sides * was_sides >= was * is_sides * is_sides;
  const auto kept = same_side & (good | no_worse);
  return (kept[0] & kept[1] & kept[2] & kept[3]) != 0;
}

}  // namespace

void Stars::reset(std::vector<Triangle> triangles, std::size_t vertices) {
  triangles_ = std::move(triangles);
  star_.assign(vertices, {});
  boundary_.assign(vertices, 0);
  mark_.assign(vertices, 0);
  question_ = 0;
  list_triangles();
}

/// An inner vertex of a manifold has as many neighbours as triangles.
void Stars::find_boundary() {
  std::vector<std::uint32_t> near;
  for (std::uint32_t v = 0; v < star_.size(); ++v) {
    neighbours(v, near);
    boundary_[v] = near.size() > star_[v].size ? 1 : 0;
  }
}

void Stars::list_triangles() {
  for (const Triangle& t : triangles_) {
    for (const std::uint32_t v : t) ++star_[v].size;
  }
  std::uint32_t end = 0;
  for (Run& run : star_) {
    run.begin = end;
    end += run.size;
    run.size = 0;
  }
  runs_.reserve(2 * std::size_t{end});
  runs_.resize(end);
  for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
    for (const std::uint32_t v : triangles_[t]) runs_[star_[v].begin + star_[v].size++] = t;
  }
}

void Stars::tidy() {
  std::erase_if(triangles_, [](const Triangle& t) { return t[0] == kNone; });
  std::fill(star_.begin(), star_.end(), Run{});
  list_triangles();
}

void Stars::neighbours(std::uint32_t vertex, std::vector<std::uint32_t>& out) {
  out.clear();
  ++question_;
  for (const std::uint32_t triangle : around(vertex)) {
    for (const std::uint32_t w : triangles_[triangle]) {
      if (w == vertex || mark_[w] == question_) continue;
      mark_[w] = question_;
      out.push_back(w);
    }
  }
}

/// Around an inner vertex each neighbour follows it once.
bool Stars::inner_contractible(std::uint32_t u, std::uint32_t v) {
  ++question_;
  std::size_t shared = 0, common = 0;
  for (const std::uint32_t triangle : around(u)) {
    const Triangle& t = triangles_[triangle];
    const std::size_t k = corner_of(t, u);
    const std::uint32_t p = t[(k + 1) % 3], q = t[(k + 2) % 3];
    mark_[p] = question_;
    shared += static_cast<std::size_t>(p == v) + static_cast<std::size_t>(q == v);
  }
  for (const std::uint32_t triangle : around(v)) {
    const Triangle& t = triangles_[triangle];
    common += static_cast<std::size_t>(mark_[t[(corner_of(t, v) + 1) % 3]] == question_);
  }
  return shared == 2 && common == 2 && (around(u).size() != 3 || around(v).size() != 3);
}

bool Stars::contractible(std::uint32_t u, std::uint32_t v) {
  if (!boundary(u) && !boundary(v)) return inner_contractible(u, v);
  std::array<std::uint32_t, 2> beside{};  // the third vertices of the triangles that go
  std::size_t shared = 0;
  ++question_;
  for (const std::uint32_t triangle : around(u)) {
    const Triangle& t = triangles_[triangle];
    const std::size_t k = corner_of(t, u);
    const std::uint32_t p = t[(k + 1) % 3], q = t[(k + 2) % 3];
    mark_[p] = mark_[q] = question_;
    if (p != v && q != v) continue;
    if (shared == beside.size()) return false;
    beside[shared++] = p == v ? q : p;
  }
  if (shared == 0) return false;
  if (shared == 2 && boundary(u) && boundary(v)) return false;
  std::size_t common = 0;
  const std::uint32_t of_u = question_++;
  for (const std::uint32_t triangle : around(v)) {
    for (const std::uint32_t w : triangles_[triangle]) {
      if (w == u || w == v || mark_[w] != of_u) continue;
      mark_[w] = question_;
      ++common;
    }
  }
  if (common != shared) return false;
  const auto sides = [&](std::uint32_t vertex) {
    const auto star = around(vertex);
    return std::count_if(star.begin(), star.end(), [&](std::uint32_t t) { return names(triangles_[t], beside[0]); });
  };
  // A triangle alone would vanish; of a tetrahedron, whose corners have three triangles each, two would become one.
  if (shared == 1) return sides(u) != 1 || sides(v) != 1;
  return around(u).size() != 3 || around(v).size() != 3 || boundary(u) || boundary(v);
}

void Stars::drop(std::uint32_t vertex, std::uint32_t triangle) {
  Run& run = star_[vertex];
  std::uint32_t* out = runs_.data() + run.begin;
  for (const std::uint32_t here : around(vertex)) {
    *out = here;
    out += static_cast<std::ptrdiff_t>(here != triangle);
  }
  --run.size;
}

/// A contractible edge has two triangles at most. Which of those around it they are is not asked by branches.
int Stars::contract(std::uint32_t u, std::uint32_t v) {
  std::array<std::uint32_t, 3> going{};  // and room for one that does not
  std::size_t gone = 0;
  const Run of_u = star_[u], of_v = star_[v];
  const std::size_t begin = runs_.size();
  runs_.resize(begin + of_u.size + of_v.size);
  std::uint32_t* out = runs_.data() + begin;
  for (const std::uint32_t triangle : around(u)) {
    const auto goes = static_cast<std::size_t>(names(triangles_[triangle], v));
    *out = going[gone] = triangle;
    out += 1 - goes;
    gone += goes;
  }
  for (const std::uint32_t triangle : around(v)) {
    Triangle& t = triangles_[triangle];
    const auto goes = static_cast<std::ptrdiff_t>(names(t, u));
    t[corner_of(t, v)] = goes != 0 ? v : u;
    *out = triangle;
    out += 1 - goes;
  }
  for (std::size_t i = 0; i < gone; ++i) {
    Triangle& t = triangles_[going[i]];
    for (const std::uint32_t w : t) {
      if (w != u && w != v) drop(w, going[i]);
    }
    t[0] = kNone;
  }
  runs_.resize(static_cast<std::size_t>(out - runs_.data()));
  star_[u] = {static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(runs_.size() - begin)};
  star_[v] = {};
  boundary_[u] = boundary_[u] | boundary_[v];
  return static_cast<int>(gone);
}

Stars::Before Stars::before(std::uint32_t u, std::uint32_t v) const {
  Before before{star_[u], star_[v], boundary_[u], 0, {}, {}};
  for (const std::uint32_t triangle : around(u)) {
    const Triangle& t = triangles_[triangle];
    if (!names(t, v)) continue;
    before.triangle[before.dead] = triangle;
    before.first[before.dead++] = t[0];
  }
  return before;
}

int Stars::revert(std::uint32_t u, std::uint32_t v, const Before& before) {
  for (std::uint32_t i = before.v.begin; i < before.v.begin + before.v.size; ++i) {
    Triangle& t = triangles_[runs_[i]];
    if (t[0] != kNone) t[corner_of(t, u)] = v;
  }
  for (std::size_t i = 0; i < before.dead; ++i) {
    Triangle& t = triangles_[before.triangle[i]];
    t[0] = before.first[i];
    for (const std::uint32_t w : t) {  // its place in the run is still there
      if (w != u && w != v) runs_[star_[w].begin + star_[w].size++] = before.triangle[i];
    }
  }
  star_[u] = before.u;
  star_[v] = before.v;
  boundary_[u] = before.boundary;
  return before.dead;
}

Moves::Moves(const Vec3& to, const Vec3& a, const Vec3& b, double sliver)
    : to_(to), scale_(1), sliver2_(static_cast<float>(sliver * sliver)) {
  const double length = norm(b - a);
  if (length > 0) scale_ = 1 / length;
}

bool Moves::allowed() {
  const std::size_t whole = (size_ + kLanes - 1) / kLanes * kLanes;
  for (std::size_t lane = size_; lane < whole; ++lane) {
    for (auto& corner : corners_) {
      for (Axis& axis : corner) axis[lane] = axis[0];
    }
  }
  size_ = 0;
  for (std::size_t lane = 0; lane < whole; lane += kLanes) {
    const auto corner = [&](std::size_t which) {
      Triple at;
      for (std::size_t k = 0; k < 3; ++k) std::memcpy(&at[k], &corners_[which][k][lane], sizeof(Lanes));
      return at;
    };
    if (!keep(corner(0), corner(1), corner(2), sliver2_)) return false;
  }
  return true;
}

}  // namespace lamina::simplify

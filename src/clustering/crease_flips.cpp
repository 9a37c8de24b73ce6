#include "clustering/crease_flips.h"

#include <algorithm>
#include <set>
#include <tuple>
#include <utility>

namespace lamina {
namespace {

using meshes::area_normal;
using meshes::dot;
using meshes::unit;
using meshes::Vec3;

/// A triangle lies in the sheet of a vertex whose normal has at least this cosine (30 degrees) with its own.
constexpr double kInSheet = 0.87;

using Edge = std::array<std::uint32_t, 2>;

Edge sorted(std::uint32_t a, std::uint32_t b) {
  return {std::min(a, b), std::max(a, b)};
}

/// Which vertices are ends of some edges: a bit each, so that the many triangles far from all of them cost next to
/// nothing.
class EndsOf {
 public:
  /// One edge or more.
  explicit EndsOf(const std::vector<Edge>& edges) : first_(edges.front()[0]) {
    std::uint32_t last = 0;
    for (const Edge& e : edges) {
      first_ = std::min(first_, e[0]);
      last = std::max(last, e[1]);
    }
    words_ = (last - first_) / 64 + 1;
    bits_.assign(words_ + 1, 0);
    for (const Edge& e : edges) {
      for (const std::uint32_t v : e) bits_[(v - first_) / 64] |= std::uint64_t{1} << ((v - first_) % 64);
    }
  }
  /// Which of a triangle's vertices are, a bit each.
  [[nodiscard]] unsigned among(const std::array<std::uint32_t, 3>& t) const {
    return is(t[0]) | is(t[1]) << 1U | is(t[2]) << 2U;
  }

 private:
  [[nodiscard]] unsigned is(std::uint32_t vertex) const {
    const std::uint32_t at = vertex - first_;  // of one before the first: a large number
    return static_cast<unsigned>(bits_[std::min(at / 64, words_)] >> (at % 64) & 1U);
  }

  std::uint32_t first_, words_ = 0;
  std::vector<std::uint64_t> bits_;  ///< and a word of none, for vertices that are far off
};

}  // namespace

Edge CreaseFlips::Flip::made() const {
  return sorted(left, right);
}

bool CreaseFlips::Flip::goes_before(const Flip& other) const {
  return std::tuple(-gain, sorted(from, to)) < std::tuple(-other.gain, sorted(other.from, other.to));
}

void CreaseFlips::push(MeshSlab slab) {
  Held& held = held_.emplace_back();
  held.first = pushed_;
  pushed_ += static_cast<std::uint32_t>(slab.vertices.size());
  held.mesh = std::move(slab);
  find_bent(held);
  const std::size_t last = gone_ + held_.size() - 1;
  find_wanted(last);
  if (held_.size() > 1) decide(last - 1);
}

void CreaseFlips::finish() {
  finished_ = true;
  if (!held_.empty()) decide(gone_ + held_.size() - 1);
}

bool CreaseFlips::pop(MeshSlab& out) {
  if (held_.empty() || !held_.front().decided) return false;
  // Flips of the next slab may take triangles of this one.
  if (held_.size() > 1 ? !held_[1].decided : !finished_) return false;
  Held& here = held_.front();
  out = std::move(here.mesh);
  std::sort(here.dropped.begin(), here.dropped.end());
  auto kept = here.dropped.empty() ? out.triangles.end() : out.triangles.begin() + here.dropped.front();
  for (std::size_t i = 0; i < here.dropped.size(); ++i) {
    const std::size_t next = i + 1 < here.dropped.size() ? here.dropped[i + 1] : out.triangles.size();
    kept = std::copy(out.triangles.begin() + here.dropped[i] + 1,
                     out.triangles.begin() + static_cast<std::ptrdiff_t>(next), kept);
  }
  out.triangles.erase(kept, out.triangles.end());
  std::sort(here.added.begin(), here.added.end());
  out.triangles.insert(out.triangles.end(), here.added.begin(), here.added.end());
  held_.pop_front();
  ++gone_;
  return true;
}

std::size_t CreaseFlips::slab_of(std::uint32_t vertex) const {
  std::size_t slab = 0;
  for (std::size_t i = 1; i < held_.size(); ++i) slab += static_cast<std::size_t>(held_[i].first <= vertex);
  return slab;
}

Vec3 CreaseFlips::position_in(const Held& held, std::uint32_t vertex) {
  const VertexBatch& of = held.mesh.vertices;
  const std::uint32_t i = vertex - held.first;
  return {of.x[i], of.y[i], of.z[i]};
}

Vec3 CreaseFlips::normal_in(const Held& held, std::uint32_t vertex) {
  const VertexBatch& of = held.mesh.vertices;
  const std::uint32_t i = vertex - held.first;
  return {double{of.nx[i]}, double{of.ny[i]}, double{of.nz[i]}};
}

/// Those of the last slab.
void CreaseFlips::find_bent(Held& here) const {
  // A slab's triangles name its vertices and those of the one before.
  const Held& below = held_.size() > 1 ? held_[held_.size() - 2] : here;
  const auto normal_of = [&](std::uint32_t vertex) { return normal_in(vertex < here.first ? below : here, vertex); };
  for (std::uint32_t i = 0; i < here.mesh.triangles.size(); ++i) {
    const Triangle& t = here.mesh.triangles[i];
    const std::array<Vec3, 3> normals{normal_of(t[0]), normal_of(t[1]), normal_of(t[2])};
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t next = (k + 1) % 3;
      if (dot(normals[k], normals[next]) >= bend_) continue;
      const Edge edge = sorted(t[k], t[next]);
      here.bent.push_back({edge[0], edge[1], i, t[(k + 2) % 3], t[k] < t[next]});
    }
  }
  std::sort(here.bent.begin(), here.bent.end(), [](const BentSide& a, const BentSide& b) {
    return std::tuple(a.low, a.high, a.ascending) < std::tuple(b.low, b.high, b.ascending);
  });
}

/// The sides of two triangles, both of the slab or one of the slab below.
void CreaseFlips::find_wanted(std::size_t slab) {
  Held& here = at(slab);
  const Held* const below = slab > gone_ ? &at(slab - 1) : nullptr;
  const auto alike = [](const std::vector<BentSide>& sides, const Edge& edge) {
    return std::equal_range(sides.begin(), sides.end(), BentSide{edge[0], edge[1], 0, 0, false},
                            [](const BentSide& a, const BentSide& b) { return a.edge() < b.edge(); });
  };
  for (auto first = here.bent.begin(); first != here.bent.end();) {
    const auto side = first;
    first = std::find_if(side, here.bent.end(), [&](const BentSide& s) { return s.edge() != side->edge(); });
    if (first - side == 2) {
      want(side[0], side[1], {slab, slab}, here);
    } else if (first - side == 1 && below != nullptr) {
      const auto [other, after] = alike(below->bent, side->edge());
      if (after - other == 1) want(*side, *other, {slab, slab - 1}, here);
    }
  }
}

void CreaseFlips::want(const BentSide& one, const BentSide& other, const std::array<std::size_t, 2>& slabs,
                       Held& here) const {
  if (one.ascending == other.ascending || one.opposite == other.opposite) return;
  Flip flip{one.low,
            one.high,
            one.opposite,
            other.opposite,
            {TriangleAt{slabs[0], one.triangle}, TriangleAt{slabs[1], other.triangle}},
            0};
  if (!one.ascending) std::swap(flip.from, flip.to);
  // A slab's triangles name its vertices and those of the one before.
  const std::size_t from_slab = slab_of(flip.from), to_slab = slab_of(flip.to);
  const std::size_t left_slab = slab_of(flip.left), right_slab = slab_of(flip.right);
  const auto fits = [&](std::size_t end) {
    const auto [low, high] = std::minmax({end, left_slab, right_slab});
    return high - low <= 1;
  };
  if (!fits(from_slab) || !fits(to_slab)) return;
  const Vec3 from = position_in(held_[from_slab], flip.from), to = position_in(held_[to_slab], flip.to);
  const Vec3 left = position_in(held_[left_slab], flip.left), right = position_in(held_[right_slab], flip.right);
  const Vec3 from_normal = normal_in(held_[from_slab], flip.from), to_normal = normal_in(held_[to_slab], flip.to);
  const double after = std::min(dot(unit(area_normal(from, right, left)), from_normal),
                                dot(unit(area_normal(right, to, left)), to_normal));
  if (after < kInSheet) return;
  const Vec3 over = unit(area_normal(from, to, left)), under = unit(area_normal(to, from, right));
  const double before =
      std::min({dot(over, from_normal), dot(over, to_normal), dot(under, from_normal), dot(under, to_normal)});
  flip.gain = after - before;
  if (flip.gain > 0) here.wanted.push_back(flip);
}

/// Those of a slab that no better one stands in the way of: that takes one of the triangles, or makes the same edge.
std::vector<const CreaseFlips::Flip*> CreaseFlips::first_of_their_triangles(std::size_t slab) const {
  struct Claim {
    std::array<std::uint64_t, 2> what;
    const Flip* by;
  };
  std::vector<Claim> claims;
  const std::size_t place = slab - gone_;
  for (std::size_t i = place > 0 ? place - 1 : 0; i < std::min(place + 2, held_.size()); ++i) {
    for (const Flip& f : held_[i].wanted) {
      for (const TriangleAt& t : f.triangles) claims.push_back({{t.slab << 1U, t.index}, &f});
      const Edge edge = f.made();
      claims.push_back({{(std::uint64_t{edge[0]} << 1U) | 1U, edge[1]}, &f});
    }
  }
  std::sort(claims.begin(), claims.end(), [](const Claim& a, const Claim& b) {
    return a.what != b.what ? a.what < b.what : a.by->goes_before(*b.by);
  });
  std::set<const Flip*> beaten;
  for (std::size_t i = 1; i < claims.size(); ++i) {
    if (claims[i].what == claims[i - 1].what) beaten.insert(claims[i].by);
  }
  std::vector<const Flip*> out;
  for (const Flip& f : held_[place].wanted) {
    if (!beaten.contains(&f)) out.push_back(&f);
  }
  return out;
}

/// An edge of more than two triangles would be left by those that make one which is there.
void CreaseFlips::drop_known_edges(std::size_t slab, std::vector<const Flip*>& flips) const {
  if (flips.empty()) return;
  std::vector<Edge> made;
  made.reserve(flips.size());
  for (const Flip* f : flips) made.push_back(f->made());
  std::sort(made.begin(), made.end());
  const EndsOf ends(made);
  std::vector<Edge> known;
  const std::size_t place = slab - gone_;
  for (std::size_t i = place > 0 ? place - 1 : 0; i < std::min(place + 2, held_.size()); ++i) {
    for (const Triangle& t : held_[i].mesh.triangles) {
      const unsigned among = ends.among(t);
      if ((among & (among - 1)) == 0) continue;  // one or none
      for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t next = (k + 1) % 3;
        if ((among >> k & among >> next & 1U) == 0) continue;
        const Edge edge = sorted(t[k], t[next]);
        if (std::binary_search(made.begin(), made.end(), edge)) known.push_back(edge);
      }
    }
  }
  std::sort(known.begin(), known.end());
  std::erase_if(flips, [&](const Flip* f) { return std::binary_search(known.begin(), known.end(), f->made()); });
}

void CreaseFlips::decide(std::size_t slab) {
  Held& here = at(slab);
  here.decided = true;
  if (here.wanted.empty()) return;
  std::vector<const Flip*> flips = first_of_their_triangles(slab);
  drop_known_edges(slab, flips);
  for (const Flip* f : flips) {
    for (const TriangleAt& t : f->triangles) at(t.slab).dropped.push_back(t.index);
    for (const Triangle& t : {Triangle{f->from, f->right, f->left}, Triangle{f->right, f->to, f->left}})
      held_[slab_of(std::max({t[0], t[1], t[2]}))].added.push_back(t);
  }
}

}  // namespace lamina

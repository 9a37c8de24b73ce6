#include "simplify/fans.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <utility>

namespace lamina::simplify {

Fans::Fans(std::vector<Triangle> triangles, std::size_t vertices)
    : triangles_(std::move(triangles)), head_(vertices, kNone), next_(3 * triangles_.size(), kNone) {
  for (std::size_t corner = next_.size(); corner-- > 0;) {
    std::uint32_t& head = head_[triangles_[corner / 3][corner % 3]];
    next_[corner] = head;
    head = static_cast<std::uint32_t>(corner);
  }
}

void Fans::around(std::uint32_t vertex, std::vector<std::uint32_t>& out) const {
  out.clear();
  for (std::uint32_t c = head_[vertex]; c != kNone; c = next_[c]) {
    if (alive(c / 3)) out.push_back(c / 3);
  }
}

void Fans::neighbours(std::uint32_t vertex, std::vector<std::uint32_t>& out) const {
  out.clear();
  for (std::uint32_t c = head_[vertex]; c != kNone; c = next_[c]) {
    if (!alive(c / 3)) continue;
    const Triangle& t = triangles_[c / 3];
    out.push_back(t[(c % 3 + 1) % 3]);
    out.push_back(t[(c % 3 + 2) % 3]);
  }
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
}

int Fans::sides(std::uint32_t u, std::uint32_t v) const {
  int n = 0;
  for (std::uint32_t c = head_[u]; c != kNone; c = next_[c]) {
    if (!alive(c / 3)) continue;
    const Triangle& t = triangles_[c / 3];
    n += t[0] == v || t[1] == v || t[2] == v ? 1 : 0;
  }
  return n;
}

bool Fans::boundary(std::uint32_t vertex) const {
  // An inner vertex of a manifold has as many neighbours as triangles.
  std::size_t triangles = 0;
  neighbours(vertex, scratch_);
  for (std::uint32_t c = head_[vertex]; c != kNone; c = next_[c]) triangles += alive(c / 3) ? 1 : 0;
  return scratch_.size() > triangles;
}

bool Fans::contractible(std::uint32_t u, std::uint32_t v) {
  const int shared = sides(u, v);
  if (shared == 0 || shared > 2) return false;
  if (shared == 2 && boundary(u) && boundary(v)) return false;
  neighbours(u, of_u_);
  neighbours(v, of_v_);
  common_.clear();
  std::set_intersection(of_u_.begin(), of_u_.end(), of_v_.begin(), of_v_.end(), std::back_inserter(common_));
  if (common_.size() != static_cast<std::size_t>(shared)) return false;
  // A triangle alone would vanish.
  if (shared == 1 && sides(u, common_[0]) == 1 && sides(v, common_[0]) == 1) return false;
  // Triangles u c d and v c d would become one: a tetrahedron.
  if (shared == 2) {
    const auto spans = [&](std::uint32_t vertex) {
      for (std::uint32_t c = head_[vertex]; c != kNone; c = next_[c]) {
        if (!alive(c / 3)) continue;
        const Triangle& t = triangles_[c / 3];
        if (std::find(t.begin(), t.end(), common_[0]) != t.end() &&
            std::find(t.begin(), t.end(), common_[1]) != t.end())
          return true;
      }
      return false;
    };
    if (spans(u) && spans(v)) return false;
  }
  return true;
}

int Fans::contract(std::uint32_t u, std::uint32_t v) {
  int gone = 0;
  scratch_.clear();  // corners of what stays
  for (const std::uint32_t vertex : {v, u}) {
    for (std::uint32_t c = head_[vertex]; c != kNone; c = next_[c]) {
      if (!alive(c / 3)) continue;
      Triangle& t = triangles_[c / 3];
      t[c % 3] = u;
      if (std::count(t.begin(), t.end(), u) == 2) {
        t = {kNone, kNone, kNone};
        ++gone;
      } else {
        scratch_.push_back(c);
      }
    }
  }
  head_[v] = kNone;
  head_[u] = kNone;
  for (const std::uint32_t c : scratch_) {
    next_[c] = head_[u];
    head_[u] = c;
  }
  return gone;
}

}  // namespace lamina::simplify

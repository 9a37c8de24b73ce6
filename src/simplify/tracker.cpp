#include "simplify/tracker.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace lamina::simplify {
namespace {

using namespace meshes;

constexpr double kRounding = 1e-6;  ///< of the bound: what arithmetic may cost

float above(double error) {
  const auto f = static_cast<float>(error);
  return static_cast<double>(f) >= error ? f : std::nextafter(f, std::numeric_limits<float>::infinity());
}

constexpr int kCuts = 30;  ///< of a triangle, to prove it near another few

/// How far they lie from a point, at most.
double size_about(const std::vector<Vec3>& positions, const Vec3& origin) {
  double size = 0;
  for (const Vec3& p : positions) size = std::max(size, norm(p - origin));
  return size;
}

}  // namespace

Tracker::Tracker(const std::vector<Vec3>& positions, const std::vector<Triangle>& triangles, std::vector<Errors> errors,
                 double bound)
    : base_(positions),
      olds_(triangles.size()),
      back_(triangles.size()),
      head_(triangles.size()),
      links_(triangles.size()),
      bound_((1 - kRounding) * bound),
      origin_(positions.empty() ? Vec3{} : positions[positions.size() / 2]),
      cover_(bound_, origin_, size_about(positions, origin_) + bound) {
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    olds_[t] = {triangles[t], errors[t], errors[t].out, 1, {t}, 0};
    back_[t] = errors[t].back;
    head_[t] = t;
    links_[t] = {t, kEnd};
  }
}

void Tracker::prepare(const Stars& stars, std::span<const Vec3> positions) {
  const auto& triangles = stars.triangles();
  faces_.resize(triangles.size());
  for (std::uint32_t i = 0; i < triangles.size(); ++i) {
    const Triangle& t = triangles[i];
    if (t[0] == kNone) continue;
    faces_[i] = make_facet(positions[t[0]], positions[t[1]], positions[t[2]], origin_);
    faces_[i].id = i;
  }
  old_facets_.resize(olds_.size());
  for (std::uint32_t i = 0; i < olds_.size(); ++i) {
    const std::array<Vec3, 3> c = old_corners(olds_[i]);
    old_facets_[i] = make_facet(c[0], c[1], c[2], origin_);
    old_facets_[i].error = static_cast<double>(olds_[i].errors.back);
  }
}

void Tracker::rest() {
  faces_ = {};
  old_facets_ = {};
}

bool Tracker::allows(const Stars& stars, std::span<const Vec3> positions, std::uint32_t u, std::uint32_t v,
                     const Vec3& to) {
  if (faces_.empty()) prepare(stars, positions);
  gather(stars, u, v);
  before_.clear();
  after_.clear();
  for (const std::uint32_t triangle : star_) {
    const Triangle& t = stars.triangles()[triangle];
    std::array<Vec3, 3> c{positions[t[0]], positions[t[1]], positions[t[2]]};
    before_.push_back(faces_[triangle]);
    before_.back().error = static_cast<double>(back_[triangle]);
    if (names(t, u) && names(t, v)) continue;
    c[corner_of(t, names(t, u) ? u : v)] = to;
    after_.push_back(make_facet(c[0], c[1], c[2], origin_));
    after_.back().id = triangle;
  }
  return still_covered() && covers();
}

void Tracker::gather(const Stars& stars, std::uint32_t u, std::uint32_t v) {
  star_.clear();
  affected_.clear();
  ++question_;
  for (const std::uint32_t vertex : {u, v}) {
    for (const std::uint32_t triangle : stars.around(vertex)) {
      if (vertex == v && names(stars.triangles()[triangle], u)) continue;
      star_.push_back(triangle);
      for (std::uint32_t l = head_[triangle]; l != kEnd; l = links_[l].next) {
        Old& old = olds_[links_[l].old];
        if (old.seen == question_) continue;
        old.seen = question_;
        affected_.push_back(links_[l].old);
      }
    }
  }
}

/// Are the old triangles near what would be there?
bool Tracker::still_covered() {
  proofs_.clear();
  facets_.clear();
  for (const Facet& f : after_) facets_.push_back(&f);
  for (const std::uint32_t number : affected_) {
    const Old& old = olds_[number];
    facets_.resize(after_.size());
    for (std::size_t i = 0; i < old.size; ++i) {
      const std::uint32_t face = old.faces[i];
      if (std::find(star_.begin(), star_.end(), face) != star_.end()) continue;
      facets_.push_back(&faces_[face]);
    }
    if (!cover_.prove(old_corners(old), static_cast<double>(old.errors.out), facets_, kCuts) ||
        cover_.used().size() > kFaces)
      return false;
    Proof proof{number, above(cover_.error()), static_cast<std::uint8_t>(cover_.used().size()), {}};
    std::copy(cover_.used().begin(), cover_.used().end(), proof.faces.begin());
    proofs_.push_back(proof);
  }
  return true;
}

/// Would what is there be near the old triangles?
bool Tracker::covers() {
  after_back_.clear();
  before_list_.clear();
  for (const Facet& f : before_) before_list_.push_back(&f);
  for (const Facet& f : after_) {
    if (!cover_.prove(f.corners, 0, before_list_, kCuts)) {
      // Step by step it is too far. What about the way from the beginning?
      Vec3 low = f.corners[0], high = low;
      for (const Vec3& c : f.corners) {
        for (std::size_t k = 0; k < 3; ++k) {
          low[k] = std::min(low[k], c[k] - bound_);
          high[k] = std::max(high[k], c[k] + bound_);
        }
      }
      facets_.clear();
      for (const std::uint32_t number : affected_) {
        const std::array<Vec3, 3>& c = old_facets_[number].corners;
        bool apart = false;
        for (std::size_t k = 0; k < 3; ++k) {
          apart = apart || std::max({c[0][k], c[1][k], c[2][k]}) < low[k] ||
                  std::min({c[0][k], c[1][k], c[2][k]}) > high[k];
        }
        if (apart) continue;
        facets_.push_back(&old_facets_[number]);
      }
      if (!cover_.prove(f.corners, 0, facets_, 8 * static_cast<int>(facets_.size()))) return false;
    }
    after_back_.push_back(above(cover_.error()));
  }
  return true;
}

void Tracker::link(std::uint32_t face, std::uint32_t old) {
  std::uint32_t l = free_;
  if (l == kEnd) {
    l = static_cast<std::uint32_t>(links_.size());
    links_.emplace_back();
  } else {
    free_ = links_[l].next;
  }
  links_[l] = {old, head_[face]};
  head_[face] = l;
}

void Tracker::accept() {
  for (const std::uint32_t triangle : star_) {
    for (std::uint32_t l = head_[triangle]; l != kEnd;) {
      const std::uint32_t next = links_[l].next;
      links_[l].next = free_;
      free_ = l;
      l = next;
    }
    head_[triangle] = kEnd;
  }
  for (const Proof& proof : proofs_) {
    Old& old = olds_[proof.old];
    for (std::size_t i = 0; i < proof.size; ++i) {
      const std::uint32_t face = proof.faces[i];
      const bool known =
          std::find(old.faces.begin(), old.faces.begin() + old.size, face) != old.faces.begin() + old.size;
      const bool changed = std::find(star_.begin(), star_.end(), face) != star_.end();
      if (changed || !known) link(face, proof.old);
    }
    old.error = proof.error;
    old.size = proof.size;
    old.faces = proof.faces;
  }
  for (std::size_t i = 0; i < after_.size(); ++i) {
    back_[after_[i].id] = after_back_[i];
    faces_[after_[i].id] = after_[i];
  }
}

std::vector<Errors> Tracker::errors() const {
  std::vector<Errors> errors(back_.size());
  for (std::size_t t = 0; t < back_.size(); ++t) errors[t].back = back_[t];
  for (const Old& old : olds_) {
    for (std::size_t i = 0; i < old.size; ++i) errors[old.faces[i]].out = std::max(errors[old.faces[i]].out, old.error);
  }
  return errors;
}

}  // namespace lamina::simplify

#include "simplify/proof.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace lamina::simplify {
namespace {

using namespace meshes;

constexpr int kCuts = 30;               ///< of an old triangle
constexpr int kCutsForEach = 8;         ///< old triangle, of a present one
constexpr int kHalvings = 12;           ///< of a present triangle with many
constexpr std::size_t kFewFacets = 40;  ///< that are asked at once

float no_less_than(double error) {
  const auto f = static_cast<float>(error);
  return static_cast<double>(f) >= error ? f : std::nextafter(f, std::numeric_limits<float>::infinity());
}

/// How far they lie from a point, at most.
double size_about(const std::vector<Vec3>& positions, const Vec3& origin) {
  double size = 0;
  for (const Vec3& p : positions) size = std::max(size, norm(p - origin));
  return size;
}

Facet facet_of(const std::vector<Vec3>& positions, const Triangle& t, const Vec3& origin) {
  return make_facet(positions[t[0]], positions[t[1]], positions[t[2]], origin);
}

}  // namespace

Proof::Proof(const OldMesh& old, const Present& now)
    : old_(old),
      now_(now),
      origin_(old.positions.empty() ? Vec3{} : old.positions[old.positions.size() / 2]),
      cover_(old.bound, origin_,
             std::max(size_about(old.positions, origin_), size_about(now.positions, origin_)) + old.bound),
      faces_(old.triangles.size()),
      old_facets_(old.triangles.size()),
      proofs_(old.triangles.size()),
      back_(old.triangles.size(), -1) {}

const Facet* Proof::face_facet(std::uint32_t face) {
  if (faces_[face] == nullptr) {
    Facet& facet = facets_.emplace_back(facet_of(now_.positions, now_.stars.triangles()[face], origin_));
    facet.id = face;
    faces_[face] = &facet;
  }
  return faces_[face];
}

const Facet* Proof::old_facet(std::uint32_t number) {
  if (old_facets_[number] == nullptr) {
    Facet& facet = facets_.emplace_back(facet_of(old_.positions, old_.triangles[number], origin_));
    facet.error = static_cast<double>(old_.errors[number].back);
    facet.id = number;
    old_facets_[number] = &facet;
  }
  return old_facets_[number];
}

const std::vector<std::uint32_t>& Proof::find_failures() {
  failures_.clear();
  for (std::uint32_t i = 0; i < proofs_.size(); ++i) {
    if (!proofs_[i].done) prove_old(i);
  }
  list_olds();
  for (std::uint32_t i = 0; i < faces_.size(); ++i) {
    if (now_.stars.alive(i) && back_[i] < 0) prove_face(i);
  }
  std::sort(failures_.begin(), failures_.end());
  failures_.erase(std::unique(failures_.begin(), failures_.end()), failures_.end());
  return failures_;
}

void Proof::forget(std::span<const std::uint32_t> triangles) {
  std::vector<bool> gone(faces_.size());
  for (const std::uint32_t t : triangles) {
    gone[t] = true;
    back_[t] = -1;
    faces_[t] = nullptr;
  }
  for (OldProof& proof : proofs_) {
    for (std::size_t i = 0; i < proof.size && proof.done; ++i) proof.done = !gone[proof.faces[i]];
  }
}

void Proof::add_face(std::uint32_t face) {
  if (std::find(asked_.begin(), asked_.end(), face) != asked_.end()) return;
  asked_.push_back(face);
  list_.push_back(face_facet(face));
}

/// Is an old triangle near the homes of its corners? If not, near what is around these?
void Proof::prove_old(std::uint32_t number) {
  OldProof& proof = proofs_[number];
  const Triangle& corners = old_.triangles[number];
  const auto error = static_cast<double>(old_.errors[number].out);
  if (now_.stars.alive(number) && !changed(number)) {
    proof.faces[0] = number;
    proof.size = 1;
    proof.error = old_.errors[number].out;
    proof.done = true;
    return;
  }
  list_.clear();
  asked_.clear();
  for (const std::uint32_t v : corners) add_face(now_.homes[v]);
  if (take_proof(proof, corners, error)) return;
  const std::size_t homes = asked_.size();
  for (std::size_t i = 0; i < homes; ++i) {
    for (const std::uint32_t v : now_.stars.triangles()[asked_[i]]) {
      for (const std::uint32_t face : now_.stars.around(v)) add_face(face);
    }
  }
  if (take_proof(proof, corners, error)) return;
  const std::span<const std::uint32_t> all(asked_);
  const bool at_home = std::any_of(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(homes),
                                   [&](std::uint32_t face) { return changed(face); });
  blame(at_home ? all.first(homes) : all);
}

bool Proof::take_proof(OldProof& proof, const Triangle& corners, double error) {
  const std::array<Vec3, 3> triangle{old_.positions[corners[0]], old_.positions[corners[1]],
                                     old_.positions[corners[2]]};
  if (!cover_.prove(triangle, error, list_, kCuts) || cover_.used().size() > kFaces) return false;
  proof.error = no_less_than(cover_.error());
  proof.size = static_cast<std::uint8_t>(cover_.used().size());
  std::copy(cover_.used().begin(), cover_.used().end(), proof.faces.begin());
  proof.done = true;
  return true;
}

/// By the proofs and by the homes of their corners.
void Proof::list_olds() {
  const auto visit = [&](auto&& each) {
    for (std::uint32_t i = 0; i < proofs_.size(); ++i) {
      const OldProof& proof = proofs_[i];
      for (std::size_t k = 0; k < proof.size; ++k) each(proof.faces[k], i);
      for (std::size_t c = 0; c < 3; ++c) {
        const std::uint32_t home = now_.homes[old_.triangles[i][c]];
        bool listed =
            std::find(proof.faces.begin(), proof.faces.begin() + proof.size, home) != proof.faces.begin() + proof.size;
        for (std::size_t d = 0; d < c; ++d) listed = listed || now_.homes[old_.triangles[i][d]] == home;
        if (!listed) each(home, i);
      }
    }
  };
  begins_.assign(faces_.size() + 1, 0);
  visit([&](std::uint32_t face, std::uint32_t) { ++begins_[face]; });
  std::uint32_t end = 0;
  for (std::uint32_t& begin : begins_) begin = end += begin;
  olds_.resize(end);
  visit([&](std::uint32_t face, std::uint32_t number) { olds_[--begins_[face]] = number; });
}

/// Is a present triangle near the old ones that lie there? If not, near those that lie around it?
void Proof::prove_face(std::uint32_t face) {
  if (!changed(face)) {
    back_[face] = old_.errors[face].back;
    return;
  }
  const std::array<Vec3, 3>& corners = face_facet(face)->corners;
  list_.clear();
  for (const std::uint32_t number : olds_at(face)) list_.push_back(old_facet(number));
  back_[face] = prove_near_old(corners, list_, kHalvings);
  if (back_[face] >= 0) return;
  asked_.clear();
  for (const std::uint32_t v : now_.stars.triangles()[face]) {
    for (const std::uint32_t other : now_.stars.around(v)) {
      const auto olds = olds_at(other);
      asked_.insert(asked_.end(), olds.begin(), olds.end());
    }
  }
  std::sort(asked_.begin(), asked_.end());
  asked_.erase(std::unique(asked_.begin(), asked_.end()), asked_.end());
  list_.clear();
  for (const std::uint32_t number : asked_) list_.push_back(old_facet(number));
  back_[face] = prove_near_old(corners, list_, kHalvings);
  if (back_[face] < 0) blame(std::span(&face, 1));
}

/// How near it is, or -1. Where there are many facets it is halved.
float Proof::prove_near_old(const std::array<Vec3, 3>& triangle, const std::vector<const Facet*>& all, int halvings) {
  if (all.size() <= kFewFacets) {
    if (!cover_.prove(triangle, 0, all, kCutsForEach * static_cast<int>(all.size()))) return -1;
    return no_less_than(cover_.error());
  }
  std::array<double, 3> low{}, high{};
  for (std::size_t k = 0; k < 3; ++k) {
    low[k] = std::min({triangle[0][k], triangle[1][k], triangle[2][k]}) - old_.bound;
    high[k] = std::max({triangle[0][k], triangle[1][k], triangle[2][k]}) + old_.bound;
  }
  std::vector<const Facet*> near;
  for (const Facet* facet : all) {
    const auto& [a, b, c] = facet->corners;
    bool apart = false;
    for (std::size_t k = 0; k < 3; ++k)
      apart = apart || std::max({a[k], b[k], c[k]}) < low[k] || std::min({a[k], b[k], c[k]}) > high[k];
    if (!apart) near.push_back(facet);
  }
  if (near.size() <= kFewFacets) return prove_near_old(triangle, near, halvings);
  if (halvings == 0) return -1;
  std::size_t longest = 0;
  for (std::size_t k = 1; k < 3; ++k) {
    const auto length = [&](std::size_t i) { return norm(triangle[(i + 1) % 3] - triangle[i]); };
    if (length(k) > length(longest)) longest = k;
  }
  const Vec3 &a = triangle[longest], &b = triangle[(longest + 1) % 3], &c = triangle[(longest + 2) % 3];
  const Vec3 middle = 0.5 * (a + b);
  const float first = prove_near_old({a, middle, c}, near, halvings - 1);
  if (first < 0) return -1;
  const float second = prove_near_old({middle, b, c}, near, halvings - 1);
  return second < 0 ? -1 : std::max(first, second);
}

void Proof::blame(std::span<const std::uint32_t> faces) {
  bool any = false;
  for (const std::uint32_t face : faces) {
    if (!changed(face)) continue;
    failures_.push_back(face);
    any = true;
  }
  if (any) return;
  for (std::uint32_t i = 0; i < faces_.size(); ++i) {  // nothing near has changed: not to be expected
    if (now_.stars.alive(i) && changed(i)) failures_.push_back(i);
  }
}

std::vector<Errors> Proof::errors() const {
  std::vector<Errors> errors(back_.size());
  for (std::size_t t = 0; t < back_.size(); ++t) errors[t].back = std::max(back_[t], 0.0F);
  for (const OldProof& proof : proofs_) {
    for (std::size_t i = 0; i < proof.size; ++i)
      errors[proof.faces[i]].out = std::max(errors[proof.faces[i]].out, proof.error);
  }
  return errors;
}

}  // namespace lamina::simplify

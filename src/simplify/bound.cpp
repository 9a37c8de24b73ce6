#include "simplify/bound.h"

#include <algorithm>
#include <limits>

namespace lamina::simplify {
namespace {

using namespace meshes;

constexpr float kTightened = 0.8F;
constexpr double kUsed = 0.995;      ///< of the bound: the other way it is a little farther
constexpr float kSurelyNear = 0.3F;  ///< of what is left of the bound: root mean square of distances taken on trust
/// Of a piece: as few are left of large triangles, each of which counts. Pieces that meshes are cut into have more.
constexpr std::size_t kFewTriangles = 12'000;
constexpr double kRimUsed = 0.6;  ///< of the bound: root mean square distance of a boundary vertex from the boundary

}  // namespace

Tracker::Tracker(const OldMesh& old)
    : old_(old),
      origin_(Extent(old).origin),
      near_old_(old),
      rims_(old.positions.size()),
      back_(old.triangles.size()),
      room_(old.triangles.size()),
      spare_(old.triangles.size()),
      under_(old.triangles.size()),
      homes_(old.triangles.size()) {
  for (std::uint32_t i = 0; i < old.triangles.size(); ++i) {
    const auto& [corners, twins, errors] = old.triangles[i];
    back_[i] = errors.back;
    room_[i] = static_cast<float>(kUsed * old.bound);
    spare_[i] = static_cast<float>(old.bound) - std::max(errors.out, errors.back);
    under_[i] = homes_[i] = i;
    for (std::size_t k = 0; k < 3; ++k) {
      if (twins[k] == kNone) add_rim(corners[k], corners[(k + 1) % 3]);
    }
  }
}

void Tracker::add_rim(std::uint32_t from, std::uint32_t to) {
  const Vec3 at = old_.positions[from] - origin_, edge = old_.positions[to] - old_.positions[from], along = unit(edge);
  const double weight = dot(edge, edge), d = dot(along, at);
  Quadric line;
  line.a = {weight * (1 - along[0] * along[0]), -weight * along[0] * along[1], -weight * along[0] * along[2],
            weight * (1 - along[1] * along[1]), -weight * along[1] * along[2], weight * (1 - along[2] * along[2])};
  line.b = weight * (at - d * along);
  line.c = weight * (dot(at, at) - d * d);
  rims_[from] += line;
  rims_[to] += line;
}

/// Is the place as near the boundary edges that both stand for?
bool Tracker::rim_allows(std::uint32_t u, std::uint32_t v, const Vec3& to) const {
  Quadric sum = rims_[u];
  sum += rims_[v];
  const double most = kRimUsed * old_.bound;
  return sum.weight() <= 0 || 2 * sum.at(to - origin_) <= sum.weight() * most * most;
}

bool Tracker::allows(const Stars& stars, std::span<const Vec3> positions, std::uint32_t u, std::uint32_t v,
                     const Vec3& to) {
  if (!rim_allows(u, v, to)) return false;
  // At a boundary the mesh ends, elsewhere it turns away: there, to ask in another way takes long and hardly pays,
  // since what grows from such a place is often taken back.
  const bool asks_again = stars.boundary(u) || stars.boundary(v) || old_.triangles.size() <= kFewTriangles;
  after_.clear();
  uses_.clear();
  room_after_ = spare_after_ = static_cast<float>(kUsed * old_.bound);
  for (const std::uint32_t vertex : {u, v}) {
    for (const std::uint32_t triangle : stars.around(vertex)) {
      room_after_ = std::min(room_after_, room_[triangle]);
      spare_after_ = std::min(spare_after_, spare_[triangle]);
    }
  }
  for (const std::uint32_t vertex : {u, v}) {
    for (const std::uint32_t triangle : stars.around(vertex)) {
      const Triangle& t = stars.triangles()[triangle];
      if (names(t, vertex == u ? v : u)) continue;
      const std::size_t k = corner_of(t, vertex);
      const NearOld::Corners corners{to, positions[t[(k + 1) % 3]], positions[t[(k + 2) % 3]]};
      const auto most = static_cast<double>(room_after_);
      const NearOld::Answer answer = near_old_.look(corners, under_[triangle], most);
      if (answer == NearOld::Answer::far) return false;
      if (answer == NearOld::Answer::unclear && !(asks_again && near_old_.prove(corners, under_[triangle], most)))
        return false;
      const auto used = near_old_.used();
      uses_.insert(uses_.end(), used.begin(), used.end());
      after_.push_back({triangle, near_old_.begin(), near_old_.error(), static_cast<std::uint32_t>(uses_.size())});
    }
  }
  return true;
}

bool Tracker::takes_on_trust(const Stars& stars, std::uint32_t u, std::uint32_t v, double mean_square) {
  if (stars.boundary(u) || stars.boundary(v)) return false;
  float spare = std::numeric_limits<float>::infinity();
  for (const std::uint32_t vertex : {u, v}) {
    for (const std::uint32_t triangle : stars.around(vertex)) spare = std::min(spare, spare_[triangle]);
  }
  const auto most = static_cast<double>(kSurelyNear * spare);
  if (!(most > 0) || mean_square > most * most) return false;
  after_.clear();
  for (const std::uint32_t vertex : {u, v}) {
    for (const std::uint32_t triangle : stars.around(vertex)) {
      back_[triangle] = -1;
      spare_[triangle] = spare;
    }
  }
  return true;
}

void Tracker::accept(std::uint32_t u, std::uint32_t v) {
  rims_[u] += rims_[v];
  std::size_t use = 0;
  for (const After& after : after_) {
    back_[after.triangle] = after.back;
    room_[after.triangle] = room_after_;
    spare_[after.triangle] = spare_after_;
    under_[after.triangle] = after.under;
    for (; use < after.uses; ++use) homes_[uses_[use]] = after.triangle;
  }
}

void Tracker::undo(std::uint32_t u, std::uint32_t v) {
  Quadric less = rims_[v];
  for (double& a : less.a) a = -a;
  less.b = -1 * less.b;
  less.c = -less.c;
  rims_[u] += less;
}

void Tracker::tighten(std::uint32_t triangle) {
  room_[triangle] *= kTightened;
  spare_[triangle] = 0;
}
namespace {

constexpr int kCuts = 30;  ///< of an old triangle

/// For Overlay.
struct PresentView {
  const Present& now;
  [[nodiscard]] const Vec3& position(std::uint32_t v) const { return now.positions[v]; }
  [[nodiscard]] const Triangle& triangle(std::uint32_t t) const { return now.stars.triangles()[t]; }
  [[nodiscard]] std::uint32_t twin(std::uint32_t side) const {
    const auto& triangles = now.stars.triangles();
    return find_twin(triangles, side, now.stars.around(triangles[side / 3][side % 3]));
  }
  [[nodiscard]] static double error(std::uint32_t) { return 0; }
  [[nodiscard]] static double needs(std::uint32_t) { return 0; }
};

}  // namespace

Proof::Proof(const OldMesh& old, const Present& now, Tracker& tracker)
    : old_(old),
      now_(now),
      tracker_(tracker),
      extent_(old),
      cover_(old.bound, extent_.origin, extent_.size),
      overlay_(old.triangles.size()),
      faces_(old.triangles.size()),
      proofs_(old.triangles.size()),
      searched_(old.triangles.size()) {
  for (std::uint32_t face = 0; face < faces_.size(); ++face) back_.push_back(tracker.back(face));
}

Proof::Corners Proof::corners_of(std::uint32_t face) const {
  const Triangle& t = now_.stars.triangles()[face];
  return {now_.positions[t[0]], now_.positions[t[1]], now_.positions[t[2]]};
}

const Facet* Proof::face_facet(std::uint32_t face) {
  if (faces_[face] == nullptr) {
    const Corners c = corners_of(face);
    Facet& facet = facets_.emplace_back(make_facet(c[0], c[1], c[2], extent_.origin));
    facet.id = face;
    faces_[face] = &facet;
  }
  return faces_[face];
}

const std::vector<std::uint32_t>& Proof::find_failures() {
  failures_.clear();
  for (std::uint32_t i = 0; i < faces_.size(); ++i) {
    if (now_.stars.alive(i) && back_[i] < 0) prove_face(i);
  }
  for (std::uint32_t i = 0; i < proofs_.size(); ++i) {
    if (!proofs_[i].done) prove_old(i);
  }
  std::sort(failures_.begin(), failures_.end());
  failures_.erase(std::unique(failures_.begin(), failures_.end()), failures_.end());
  return failures_;
}

void Proof::forget(std::span<const std::uint32_t> triangles) {
  std::vector<bool> gone(faces_.size());
  for (const std::uint32_t t : triangles) {
    gone[t] = true;
    back_[t] = tracker_.back(t);
    faces_[t] = nullptr;
  }
  for (OldProof& proof : proofs_) {
    const auto faces = faces_of(proof);
    proof.done = proof.done && std::none_of(faces.begin(), faces.end(), [&](std::uint32_t f) { return gone[f]; });
  }
}

void Proof::add_face(std::uint32_t face) {
  if (!now_.stars.alive(face) || std::find(asked_.begin(), asked_.end(), face) != asked_.end()) return;
  asked_.push_back(face);
  list_.push_back(face_facet(face));
}

/// A present triangle near an old one, or kNone: its own home, or that of one that is found from there on.
std::uint32_t Proof::home_of(std::uint32_t number) {
  queue_.assign(1, number);
  ++search_;
  searched_[number] = search_;
  for (std::size_t next = 0; next < queue_.size(); ++next) {
    const std::uint32_t home = tracker_.home(queue_[next]);
    if (now_.stars.alive(home)) return home;
    for (const std::uint32_t v : old_.triangles[queue_[next]].corners) {
      for (const std::uint32_t other : old_.around(v)) {
        if (searched_[other] == search_) continue;
        searched_[other] = search_;
        queue_.push_back(other);
      }
    }
  }
  return kNone;
}

/// Is an old triangle near the present ones that are seen over it? If not, near the homes of those at its corners? Or
/// near what is around these?
void Proof::prove_old(std::uint32_t number) {
  OldProof& proof = proofs_[number];
  const Triangle& t = old_.triangles[number].corners;
  const auto error = static_cast<double>(old_.triangles[number].errors.out);
  if (now_.stars.alive(number) && !changed(number)) {
    keep(proof, old_.triangles[number].errors.out, std::span(&number, 1));
    return;
  }
  const Corners corners{old_.positions[t[0]], old_.positions[t[1]], old_.positions[t[2]]};
  list_.clear();
  asked_.clear();
  if (const std::uint32_t home = home_of(number); home != kNone) {
    const Overlay::Answer answer = overlay_.prove(corners, PresentView{now_}, home, old_.bound - error);
    const auto seen = overlay_.used();
    if (answer == Overlay::Answer::near) {
      keep(proof, no_less_than(overlay_.error() + error), seen);
      return;
    }
    add_face(home);
    if (answer == Overlay::Answer::likely) {
      for (const std::uint32_t face : seen) add_face(face);
      if (take_proof(proof, corners, error)) return;
    }
  }
  for (const std::uint32_t v : t) {
    for (const std::uint32_t other : old_.around(v)) add_face(tracker_.home(other));
  }
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

bool Proof::take_proof(OldProof& proof, const Corners& corners, double error) {
  if (!cover_.prove(corners, error, list_, kCuts)) return false;
  keep(proof, no_less_than(cover_.error()), cover_.used());
  return true;
}

/// A list that is no longer than the one before takes its place.
void Proof::keep(OldProof& proof, float error, std::span<const std::uint32_t> faces) {
  if (faces.size() > proof.count) {
    proof.begin = proved_by_.size();
    proved_by_.resize(proved_by_.size() + faces.size());
  }
  std::copy(faces.begin(), faces.end(), proved_by_.begin() + static_cast<std::ptrdiff_t>(proof.begin));
  proof.count = static_cast<std::uint32_t>(faces.size());
  proof.error = error;
  proof.done = true;
}

void Proof::prove_face(std::uint32_t face) {
  if (!changed(face)) {
    back_[face] = old_.triangles[face].errors.back;
    return;
  }
  NearOld& near_old = tracker_.near_old();
  if (near_old.prove(corners_of(face), tracker_.under(face), old_.bound)) {
    back_[face] = near_old.error();
    for (const std::uint32_t old : near_old.used()) tracker_.put_home(old, face);
  } else {
    blame(std::span(&face, 1));
  }
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
    for (const std::uint32_t face : faces_of(proof)) errors[face].out = std::max(errors[face].out, proof.error);
  }
  return errors;
}

}  // namespace lamina::simplify

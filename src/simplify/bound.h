// That a piece stays within the bound of what it was, and that within the bound of the piece: while edges are
// contracted, and proved when that is done.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "meshes/vec3.h"
#include "simplify/cover.h"
#include "simplify/old_mesh.h"
#include "simplify/overlay.h"
#include "simplify/quadric.h"
#include "simplify/stars.h"

namespace lamina::simplify {

/// Allows contractions whose new triangles are proved to lie near the old ones. That the old ones lie near them, too,
/// is hardly ever untrue then: Proof tells.
class Tracker {
 public:
  /// Refers to the mesh, which is also the present one.
  explicit Tracker(const OldMesh& old);

  /// May u and v become one vertex at `to`?
  bool allows(const Stars& stars, std::span<const meshes::Vec3> positions, std::uint32_t u, std::uint32_t v,
              const meshes::Vec3& to);
  /// The same where it goes without saying: `mean_square` of the distances of the new vertex from the planes it stands
  /// for is small. A present triangle there is not known to be near then.
  bool takes_on_trust(const Stars& stars, std::uint32_t u, std::uint32_t v, double mean_square);
  /// What was allowed last is done.
  void accept(std::uint32_t u, std::uint32_t v);
  /// It has been taken back.
  void undo(std::uint32_t u, std::uint32_t v);
  /// A present triangle is as it was before, or has to be nearer from now on and is taken for nothing on trust.
  void forget(std::uint32_t triangle) { back_[triangle] = -1; }
  void tighten(std::uint32_t triangle);

  /// Of a present triangle how near it is to the old ones, their errors added; below 0: not known.
  [[nodiscard]] float back(std::uint32_t triangle) const { return back_[triangle]; }
  /// An old triangle near a present one.
  [[nodiscard]] std::uint32_t under(std::uint32_t triangle) const { return under_[triangle]; }
  /// Of an old triangle: one that was near it when it was made.
  [[nodiscard]] std::uint32_t home(std::uint32_t old) const { return homes_[old]; }
  void put_home(std::uint32_t old, std::uint32_t triangle) { homes_[old] = triangle; }
  [[nodiscard]] NearOld& near_old() { return near_old_; }

 private:
  /// A triangle that the contraction in question would change.
  struct After {
    std::uint32_t triangle, under;
    float back;
    std::uint32_t uses;  ///< where its old triangles end in uses_
  };

  void add_rim(std::uint32_t from, std::uint32_t to);
  [[nodiscard]] bool rim_allows(std::uint32_t u, std::uint32_t v, const meshes::Vec3& to) const;

  const OldMesh& old_;
  meshes::Vec3 origin_;
  NearOld near_old_;
  std::vector<Quadric> rims_;  ///< of the vertices: squared distances from boundary edges, about the origin
  std::vector<float> back_;    ///< of the present triangles
  std::vector<float> room_;    ///< what they may be away
  std::vector<float> spare_;   ///< what the errors of the old ones leave of the bound
  std::vector<std::uint32_t> under_;
  std::vector<std::uint32_t> homes_;  ///< of the old triangles
  std::vector<After> after_;
  std::vector<std::uint32_t> uses_;
  float room_after_ = 0, spare_after_ = 0;
};

/// A piece as it is now.
struct Present {
  const Stars& stars;
  const std::vector<meshes::Vec3>& positions;
  const std::vector<std::uint32_t>& changes;  ///< of the triangles; kNone: as it was
};

/// Proves it triangle by triangle. Where that fails, contractions have to be taken back: then what has changed is
/// proved anew.
class Proof {
 public:
  using Corners = std::array<meshes::Vec3, 3>;

  /// Refers to all of it. `tracker`: what it knows of present triangles is not asked again.
  Proof(const OldMesh& old, const Present& now, Tracker& tracker);

  /// Present triangles, not as they were, beside which something cannot be proved; none: everything is.
  const std::vector<std::uint32_t>& find_failures();
  /// These have been put back to something they were before, or are there again.
  void forget(std::span<const std::uint32_t> triangles);

  /// Of the triangles, those present now.
  [[nodiscard]] std::vector<Errors> errors() const;

 private:
  struct OldProof {
    float error = 0;  ///< of its points to the present mesh, its own added
    bool done = false;
    std::uint32_t count = 0;  ///< of the present triangles it is near, in proved_by_
    std::size_t begin = 0;
  };

  void prove_old(std::uint32_t number);
  std::uint32_t home_of(std::uint32_t number);
  bool take_proof(OldProof& proof, const Corners& corners, double error);
  void keep(OldProof& proof, float error, std::span<const std::uint32_t> faces);
  [[nodiscard]] std::span<const std::uint32_t> faces_of(const OldProof& proof) const {
    return {proved_by_.data() + proof.begin, proof.count};
  }
  void prove_face(std::uint32_t face);
  [[nodiscard]] Corners corners_of(std::uint32_t face) const;
  const Facet* face_facet(std::uint32_t face);
  void add_face(std::uint32_t face);
  void blame(std::span<const std::uint32_t> faces);
  [[nodiscard]] bool changed(std::uint32_t face) const { return now_.changes[face] != kNone; }

  const OldMesh& old_;
  Present now_;
  Tracker& tracker_;
  Extent extent_;
  Cover cover_;
  Overlay overlay_;
  std::deque<Facet> facets_;         ///< those asked for
  std::vector<const Facet*> faces_;  ///< of the present triangles; or none yet
  std::vector<OldProof> proofs_;
  std::vector<std::uint32_t> proved_by_;  ///< present triangles, a list for each proof
  std::vector<float> back_;               ///< of the present triangles; below 0: not proved
  std::vector<std::uint32_t> failures_;
  std::vector<const Facet*> list_;
  std::vector<std::uint32_t> asked_;     ///< what is in list_
  std::vector<std::uint32_t> queue_;     ///< of a search for a home
  std::vector<std::uint32_t> searched_;  ///< of old triangles: the last search that met them
  std::uint32_t search_ = 0;
};

}  // namespace lamina::simplify

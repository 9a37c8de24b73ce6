// The proof that a piece lies within the bound of what it was, and that within the bound of the piece.
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
#include "simplify/stars.h"
#include "simplify/tracker.h"

namespace lamina::simplify {

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
  static constexpr std::size_t kFaces = 12;  ///< an old triangle lies near no more
  struct OldProof {
    float error = 0;  ///< of its points to the present mesh, its own added
    bool done = false;
    std::uint8_t size = 0;
    std::array<std::uint32_t, kFaces> faces{};
  };

  void prove_old(std::uint32_t number);
  std::uint32_t home_of(std::uint32_t number);
  bool take_proof(OldProof& proof, const Corners& corners, double error);
  bool keep(OldProof& proof, double error, std::span<const std::uint32_t> faces) const;
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
  std::vector<float> back_;  ///< of the present triangles; below 0: not proved
  std::vector<std::uint32_t> failures_;
  std::vector<const Facet*> list_;
  std::vector<std::uint32_t> asked_;     ///< what is in list_
  std::vector<std::uint32_t> queue_;     ///< of a search for a home
  std::vector<std::uint32_t> searched_;  ///< of old triangles: the last search that met them
  std::uint32_t search_ = 0;
};

}  // namespace lamina::simplify

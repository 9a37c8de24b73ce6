// Vertex clustering of the streamed isosurface (Cuccuru et al. 2009, section 3.5): none, free, or topology-preserving
// by a local exact test.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "isosurface/iso_mesh.h"
#include "lamina/clustering.h"

namespace lamina {

struct ClusterSettings {
  ClusterMode mode = ClusterMode::preserving;
};

/// A vertex of the final mesh.
struct FinalVertex {
  enum class Kind : std::uint8_t {
    isovertex,  ///< an isovertex that stayed: on its edge, interpolated between `corner` (low) and `other` (high) at t
    corner,     ///< a collapsed component: at the projected point of `corner`
    patch,      ///< one of several collapsed components of a corner: quadric placement; attributes of `corner`
  };
  Kind kind = Kind::isovertex;
  SlabIndex corner;  ///< relative to FinalSlab::slab
  SlabIndex other;   ///< relative to FinalSlab::slab; of a patch its place in FinalSlab::patches
  float t = 0;
};

/// A finished slab: vertices are numbered globally in order of slabs; triangles index globally.
struct FinalSlab {
  std::int64_t slab = 0;
  std::vector<FinalVertex> vertices;
  std::vector<std::array<float, 3>> patches;  ///< where they lie: offsets from the positions of their corners, in steps
  std::vector<std::array<std::uint32_t, 3>>
      triangles;  ///< global vertex numbers; their vertices are out already or are here
};

/// Sliding clusterer: push iso slabs in ascending order without gaps (empty ones included), pop finished slabs.
/// Decisions are local and free of order: the result does not depend on how the surface is cut into slabs, except for
/// the numbering (slab by slab, canonical order inside).
class Clusterer {
 public:
  explicit Clusterer(const ClusterSettings& settings);
  ~Clusterer();
  Clusterer(const Clusterer&) = delete;
  Clusterer& operator=(const Clusterer&) = delete;
  /// Takes the next slab. `slab` is kept alive by the caller's shared_ptr as long as finished slabs refer to it.
  void push(std::shared_ptr<const IsoSlab> slab);
  void finish();  ///< no more slabs come
  /// The next finished slab in order, false when none is ready.
  bool pop(FinalSlab& out);
  [[nodiscard]] const ClusterCounts& counts() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace lamina

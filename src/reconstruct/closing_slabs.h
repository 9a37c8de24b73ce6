// Finished slabs on their way to a mesh file, whose holes are closed at its end.
#pragma once
#include "boundary/hole_closer.h"
#include "boundary/rim_finder.h"
#include "lamina/surface.h"
#include "reconstruct/mesh_output.h"

namespace lamina {

/// Passes slabs on and watches for rims.
class ClosingSlabs final : public SlabSink {
 public:
  /// `settings`, `attributes`: as HoleCloser.
  ClosingSlabs(const HoleSettings& settings, std::size_t attributes, SlabSink& to)
      : closer_(settings, attributes), to_(to) {}
  void write(const FinalSlab& slab, const VertexBatch& vertices) override;
  /// All slabs have come: what is to be added to the mesh.
  holes::Addition finish();
  [[nodiscard]] const HoleStats& stats() const { return closer_.stats(); }

 private:
  holes::RimFinder finder_;
  holes::HoleCloser closer_;
  holes::RimPiece piece_;
  std::uint64_t vertices_ = 0;
  SlabSink& to_;
};

/// Adds to the mesh, which has all slabs, what closes its holes.
HoleStats close_holes(ClosingSlabs& slabs, MeshSink& sink);

}  // namespace lamina

#include "reconstruct/closing_slabs.h"

namespace lamina {

void ClosingSlabs::write(const FinalSlab& slab, const VertexBatch& vertices) {
  piece_.clear();
  finder_.add(vertices, slab.triangles, piece_);
  closer_.add(piece_);
  vertices_ += vertices.size();
  to_.write(slab, vertices);
}

holes::Addition ClosingSlabs::finish() {
  piece_.clear();
  finder_.finish(/*more=*/false, piece_);
  closer_.add(piece_);
  return closer_.finish(vertices_);
}

HoleStats close_holes(ClosingSlabs& slabs, MeshSink& sink) {
  const holes::Addition addition = slabs.finish();
  sink.append_vertices(addition.vertices);
  sink.append_triangles(addition.triangles);
  return slabs.stats();
}

}  // namespace lamina

// Finished slabs into parts, each of which begins at a cut.
#pragma once
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "boundary/boundary.h"
#include "chunks/part_file.h"
#include "reconstruct/mesh_output.h"

namespace lamina {

/// Successive parts: the first begins where its sweep's exact slabs do, the others where the one before ends.
class PartSlabs : public SlabSink {
 public:
  struct Part {
    int number;  ///< Chunk
    SlabSpan span;
    std::string path;
  };
  /// `job`, `count`, `holes`, `deviation`: of every part (PartInfo).
  PartSlabs(std::vector<Part> parts, int count, std::uint64_t job, const HoleSettings& holes, double deviation,
            MeshSinkSettings layout);

  /// Slabs below the first part only tell what it stands on.
  void write(const MeshSlab& slab) override;
  /// The sweep is over: finishes the parts that wait for slabs without surface.
  void finish();
  [[nodiscard]] std::uint64_t vertices() const { return vertices_; }  ///< of finished parts
  [[nodiscard]] std::uint64_t triangles() const { return triangles_; }

 private:
  void open();
  void close();
  void finish_below(std::int64_t slab);

  std::vector<Part> parts_;
  int count_;
  std::uint64_t job_;
  HoleSettings holes_;
  double deviation_;
  MeshSinkSettings layout_;
  std::size_t at_ = 0;  ///< part that the next slab may belong to
  std::optional<PartWriter> writer_;
  PartInfo info_;
  SlabMark previous_;                ///< the slab written last
  VertexBatch below_;                ///< its vertices
  boundary::BoundaryFinder finder_;  ///< of the part
  boundary::BoundaryBatch boundary_;
  std::uint64_t numbered_ = 0;  ///< vertices so far, as the clusterer counts
  std::uint64_t first_ = 0;     ///< number of the part's first vertex
  std::uint64_t vertices_ = 0, triangles_ = 0;
  std::vector<PartTriangle> relative_;
};

/// Vertex numbers relative to a part that begins with vertex `first` on a slab of `below` vertices: from -below on.
/// Throws Error(internal) for numbers below that, Error(budget) where 32 bits do not hold them.
void make_relative(const std::vector<std::array<std::uint32_t, 3>>& triangles, std::uint64_t first, std::uint64_t below,
                   std::vector<PartTriangle>& out);

}  // namespace lamina

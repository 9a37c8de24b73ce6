// One mesh, written by all ranks at their places in one file.
#pragma once
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "base/spill_file.h"
#include "boundary/boundary.h"
#include "chunks/part_file.h"
#include "lamina/holes.h"
#include "ranks/ranks.h"
#include "reconstruct/job.h"
#include "reconstruct/mesh_output.h"
#include "reconstruct/stages.h"

namespace lamina::ranks {

// A rank's part of the mesh, in unnamed files until all ranks know where theirs begin.

/// Takes the finished slabs of a sweep through `span`: records of the final PLY, triangles by numbers from the part's
/// first vertex on (PartTriangle). Keeps little of it in memory.
class RankSlabs : public SlabSink {
 public:
  /// Throws Error(budget) when `directory` cannot be written.
  RankSlabs(const SlabSpan& span, MeshSinkSettings layout, const std::string& directory);
  void write(const MeshSlab& slab) override;

  [[nodiscard]] const SlabSpan& span() const { return span_; }
  [[nodiscard]] std::uint64_t vertices() const { return vertices_; }
  [[nodiscard]] std::uint64_t triangles() const { return triangles_; }
  [[nodiscard]] bool any() const { return begun_; }               ///< a slab of its own had surface
  [[nodiscard]] const SlabMark& below() const { return below_; }  ///< PartInfo::below
  [[nodiscard]] const SlabMark& last() const { return last_; }    ///< PartInfo::last
  [[nodiscard]] const MeshSinkSettings& layout() const { return layout_; }
  [[nodiscard]] std::uint64_t disk_bytes() const { return records_.size() + faces_.size(); }
  /// After the sweep: hands over all of it, piece by piece, in order.
  void read_vertices(const std::function<void(std::span<const std::byte>)>& take);
  /// After the sweep, once: the boundary of the part, packed (boundary/boundary.h).
  std::vector<std::byte> take_boundary();
  void read_triangles(const std::function<void(std::span<const PartTriangle>)>& take);

 private:
  SlabSpan span_;
  MeshSinkSettings layout_;
  SpillFile records_, faces_;
  bool begun_ = false;
  VertexBatch stands_on_;  ///< vertices of the slab below the part
  boundary::BoundaryFinder finder_;
  boundary::BoundaryBatch boundary_;
  std::vector<std::byte> packed_boundary_;  ///< packed
  SlabMark below_, last_;
  std::uint64_t first_ = 0;  ///< vertices below the part, as the clusterer counts
  std::uint64_t vertices_ = 0, triangles_ = 0;
  std::vector<PartTriangle> relative_;
};

/// What ranks must know of each other's parts: small, whatever the mesh.
struct Border {
  SlabSpan span;
  bool any = false;
  SlabMark below, last;
  std::uint64_t vertices = 0, triangles = 0;
};

/// Where a rank's part begins in the mesh, and how large that is.
struct Place {
  std::uint64_t first_vertex = 0, first_triangle = 0;
  std::uint64_t vertices = 0, triangles = 0;
};

/// The place of part `rank`. Throws Error(internal) where two parts do not agree on the surface between them, and
/// Error(budget) beyond the vertices that a PLY's indices can name; `name`: the mesh, for the message.
Place find_place(std::span<const Border> parts, std::size_t rank, const std::string& name);

/// Writes the plan's mesh under its names, holes closed; it appears when all have written. The place is that
/// of this rank, the holes are known to rank 0 (job.stats). Throws Error(empty) where no rank has a triangle.
Place write_together(Ranks& ranks, const ReconstructionPlan& plan, RankSlabs& part,
                     const std::vector<std::string>& outputs, Job& job);

}  // namespace lamina::ranks

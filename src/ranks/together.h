// What ranks do together: read the input, gather the samples where they are worked on, write one mesh.
#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/spill_file.h"
#include "boundary/boundary.h"
#include "chunks/part_file.h"
#include "lamina/holes.h"
#include "lamina/points.h"
#include "ranks/ranks.h"
#include "reconstruct/job.h"
#include "reconstruct/mesh_output.h"
#include "reconstruct/stages.h"
#include "samples/sample_feed.h"
#include "samples/sampling_survey.h"
#include "store/ingest.h"

namespace lamina::ranks {

/// In the place of the input on the other ranks: the rows that rank 0 sends, in order.
class DealtRows : public PointSource {
 public:
  DealtRows(Ranks& ranks, const PointSourceInfo& info);
  /// Runs work that reads. Rank 0 meanwhile is in deal_rows().
  void take(const std::function<void()>& work);
  /// Throws Error(internal) when rank 0 has no more, for it or another has failed.
  void read(std::uint64_t first, std::size_t count, SampleBatch& out) override;

 private:
  Ranks& ranks_;
};

/// Rank 0: does its own `work` with the source, then deals out what the others want, rank after rank, a batch ahead of
/// them. Whatever fails, no rank is left waiting. `share`: the rows of a rank.
void deal_rows(Ranks& ranks, PointSource& source, const std::function<void()>& work,
               const std::function<RowSpan(int rank)>& share);

struct SharedInput {
  StoredCloud cloud;       ///< its store has this rank's samples, and counts those of all (declare_shares())
  std::uint64_t rows = 0;  ///< read by this rank
};

/// Rows are cut into one run per rank, in order: a bucket's samples in input order are those of rank 0, then of rank 1,
/// ... Frame and buckets are those of one process. The job's run differs by rank in what it says, not in what is
/// cancelled; where rank 0 has found normals, its statistics say so.
SharedInput read_together(Ranks& ranks, const SurfaceSettings& settings, const std::string& directory, Job& job);

// Samples go where they are worked on: each rank's store holds a part of every bucket, and then whole buckets.

/// survey_cloud() of all ranks' samples, on all ranks: rank 0 looks, the others send what it asks for.
CloudSurvey survey_together(Ranks& ranks, const SurfaceSettings& settings, const SlabStore& store);

/// A store in `directory` with the buckets that wanted[rank()] names, out of all ranks' stores, compressed blocks as
/// they are. Memory: some 16 MB, whatever the cloud.
SlabStore gather_buckets(Ranks& ranks, const SlabStore& store, const std::vector<BucketSpan>& wanted,
                         const std::string& directory, const RunContext& run);

// One mesh, written by all ranks at their places in one file.

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

// The window's pipeline: stages that slide over the slabs, each a few slabs behind the one before (Cuccuru et al.
// 2009, section 3.4).
#pragma once
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>

#include "isosurface/extract.h"
#include "levelset/surface_volume.h"
#include "mls/project.h"
#include "octree/window.h"
#include "reconstruct/job.h"
#include "reconstruct/mesh_output.h"
#include "reconstruct/plan.h"
#include "reconstruct/stages.h"
#include "samples/sample_feed.h"

namespace lamina {

/// Refine, project, extend, number, triangulate, cluster, write: run() takes the slabs through all of them, each as far
/// ahead as kStageReach says.
class Pipeline {
 public:
  /// The sink gets the finished slabs of `span`, and a few below it whose vertices but for the last of these slabs are
  /// not those of a sweep through all (the last but one's lie where they do there, but may not be moved apart). With a
  /// volume the span is plan.slabs.
  Pipeline(const ReconstructionPlan& plan, SampleFeed& feed, const SlabSpan& span, const SweepOutput& output);
  void run(const RunContext& run, Stopwatch& watch);
  void report(SurfaceStats& stats) const;

 private:
  /// Samples below this are wanted by the step that begins to triangulate with a slab.
  [[nodiscard]] std::int64_t samples_for(std::int32_t step) const;
  void mark(const Batch& buckets);
  void refine_to(std::int32_t slab);
  void project_to(std::int32_t slab);
  void extend_to(std::int32_t slab);
  void number_to(std::int32_t slab, Stopwatch& watch);
  void triangulate_to(std::int32_t slab);
  void hand_over();
  void retire();
  void note_disk();

  const ReconstructionPlan& plan_;
  SampleFeed& feed_;
  SurfaceVolume* volume_;  ///< null: none is asked for
  Kernel kernel_;
  Window window_;
  Projector projector_;
  MeshOutput output_;
  StageSpans stages_;    ///< slabs each stage has to do
  double sample_reach_;  ///< sample_reach() of the plan

  // Next slab of each stage.
  std::int32_t refined_, placed_, projected_, extended_, numbered_, triangulated_;
  std::int32_t held_;  ///< first slab of iso_
  std::int32_t covered_;
  std::deque<std::shared_ptr<IsoSlab>> iso_;  ///< slabs held_ .. numbered_ - 1
  ExtractCounts extracted_;
  std::uint64_t disk_bytes_ = 0;  ///< temporary, the most at once
  std::uint64_t isovertices_ = 0, isotriangles_ = 0;
  std::vector<std::uint64_t> leaf_cells_;
};

}  // namespace lamina

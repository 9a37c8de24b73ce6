// The window's pipeline: stages that slide over the slabs, each a few slabs behind the one before (METHOD 3.4).
#pragma once
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>

#include "isosurface/extract.h"
#include "levelset/surface_volume.h"
#include "mls/project.h"
#include "octree/window.h"
#include "reconstruct/mesh_output.h"
#include "reconstruct/plan.h"
#include "reconstruct/slab_span.h"
#include "reconstruct/stopwatch.h"
#include "samples/sample_feed.h"

namespace lamina {

/// The z of the samples that the pipeline reads for a span of slabs: [from, to); no `from`: from the bottom.
struct ZRead {
  std::optional<std::int64_t> from;
  std::int64_t to = 0;
};
ZRead z_read(const SurfaceSettings& settings, const Resolved& resolved, const SlabSpan& span, const SlabSpan& all);

/// Refine, project, finish, number, triangulate, cluster, write: run() takes the slabs through all of them.
class Pipeline {
 public:
  /// The sink gets the finished slabs of `span`, and a few below it whose vertices but for the last of these slabs are
  /// not those of a sweep through all. With a volume the span is all_slabs().
  Pipeline(const SurfaceSettings& settings, const Resolved& resolved, const Frame& frame, const Extent& extent,
           SampleFeed& feed, std::size_t attributes, SlabSink& sink, const SlabSpan& span,
           SurfaceVolume* volume = nullptr);
  void run(const RunContext& run, Stopwatch& watch);
  void report(SurfaceStats& stats) const;

 private:
  void mark(const ActiveBucket& bucket);
  void refine_to(std::int32_t slab);
  void project_to(std::int32_t slab);
  void finish_to(std::int32_t slab);
  void number_to(std::int32_t slab, Stopwatch& watch);
  void triangulate_to(std::int32_t slab);
  void hand_over();
  void retire();
  void note_disk();

  const SurfaceSettings& settings_;
  const Resolved& resolved_;
  SampleFeed& feed_;
  SurfaceVolume* volume_;  ///< null: none is asked for
  Kernel kernel_;
  Window window_;
  Projector projector_;
  MeshOutput output_;
  SlabSpan all_;       ///< slabs that can hold surface
  StageSpans stages_;  ///< slabs each stage has to do

  // Next slab of each stage.
  std::int32_t refined_, placed_, projected_, finished_, numbered_, triangulated_;
  std::int32_t held_;  ///< first slab of iso_
  std::int32_t covered_;
  std::deque<std::shared_ptr<IsoSlab>> iso_;  ///< slabs held_ .. numbered_ - 1
  ExtractCounts extracted_;
  std::uint64_t disk_bytes_ = 0;  ///< temporary, the most at once
  std::uint64_t isovertices_ = 0, isotriangles_ = 0;
  std::vector<std::uint64_t> leaf_cells_;
};

}  // namespace lamina

// The window's pipeline: stages that slide over the slabs, each a few slabs behind the one before (METHOD 3.4).
#pragma once
#include <cstdint>
#include <deque>
#include <memory>

#include "extract/extract.h"
#include "feed/sample_feed.h"
#include "lamina/mesh_sink.h"
#include "project/project.h"
#include "surface/mesh_output.h"
#include "surface/plan.h"
#include "surface/stopwatch.h"
#include "volume/surface_volume.h"
#include "window/window.h"

namespace lamina {

/// Refine, project, finish, number, triangulate, cluster, write: run() takes the slabs through all of them.
class Pipeline {
 public:
  Pipeline(const SurfaceSettings& settings, const Resolved& resolved, const Frame& frame, const Extent& extent,
           SampleFeed& feed, std::size_t attributes, MeshSink& sink, SurfaceVolume* volume = nullptr,
           Pruner* pruner = nullptr);
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
  std::int32_t first_, last_;  ///< slabs that can hold surface

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

// The end of the pipeline: triangulated slabs are clustered, placed and written while the window goes on.
#pragma once
#include <tbb/task_group.h>

#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <vector>

#include "lamina/cluster.h"
#include "lamina/frame.h"
#include "lamina/iso_mesh.h"
#include "lamina/mesh_sink.h"
#include "surface/pruner.h"

namespace lamina {

/// Slabs go in by ascending number; what comes out does not depend on when. With one thread everything happens inside
/// start().
class MeshOutput {
 public:
  /// `chord`: SurfaceSettings::chord. The sink is the caller's; nobody else may append to it. With a pruner everything
  /// goes through it.
  MeshOutput(const ClusterSettings& settings, float chord, const Frame& frame, MeshSink& sink,
             Pruner* pruner = nullptr);
  /// Drops what is not written yet.
  ~MeshOutput();
  MeshOutput(const MeshOutput&) = delete;
  MeshOutput& operator=(const MeshOutput&) = delete;

  /// Hands over the next slab; the caller must not touch it again.
  void push(std::shared_ptr<IsoSlab> slab);
  /// Waits for what was started before, then starts on the slabs handed over since. Throws what the sink threw.
  void start();
  /// Everything is in the sink when this returns: no more slabs come.
  void finish();
  /// An empty slab, with the storage of one that was written where there is any.
  std::shared_ptr<IsoSlab> spare();
  /// Written so far; at any time.
  [[nodiscard]] std::uint64_t triangles() const { return triangles_; }
  /// After finish().
  [[nodiscard]] const ClusterCounts& counts() const { return clusterer_.counts(); }

 private:
  void work(std::vector<std::shared_ptr<IsoSlab>> slabs, bool last);

  float chord_;
  const Frame& frame_;
  MeshSink& sink_;
  Pruner* pruner_;
  Clusterer clusterer_;
  std::vector<std::shared_ptr<IsoSlab>> queued_;
  std::deque<std::shared_ptr<IsoSlab>> clustered_;  ///< by the clusterer, not yet written
  FinalSlab done_;                                  ///< lent to the clusterer and back: its storage is kept
  VertexBatch vertices_;
  std::mutex mutex_;  ///< of spares_
  std::vector<std::shared_ptr<IsoSlab>> spares_;
  std::atomic<std::uint64_t> triangles_ = 0;
  tbb::task_group tasks_;
};

}  // namespace lamina

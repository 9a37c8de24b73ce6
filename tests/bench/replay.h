// The surface job's stages, each run over the whole cloud before the next begins, so that one can be timed by itself.
// Nothing is retired in between: small clouds only.
#pragma once
#include <cstdint>
#include <memory>
#include <vector>

#include "bench/scene.h"
#include "clustering/clusterer.h"
#include "isosurface/extract.h"
#include "mls/project.h"
#include "octree/window.h"
#include "samples/sample_feed.h"

namespace lamina::bench {

class Replay {
 public:
  explicit Replay(const Scene& scene, const ProjectSettings& settings = {}, const Kernel& kernel = select_kernel());

  enum class Stage { load, mark, refine, place, project, diffuse, extend, number, triangulate, cluster };
  /// Runs one stage; those before must have run (diffuse only with settings.centres, cluster is the last).
  void run(Stage stage);
  /// Runs every stage before `stage`.
  void run_before(Stage stage);

  void cluster(ClusterMode mode);
  /// Clustered vertices and triangles to a mesh file of the scene's folder; returns the number of triangles.
  std::uint64_t write() const;

  [[nodiscard]] Window& window() { return window_; }
  [[nodiscard]] SampleFeed& feed() { return feed_; }
  [[nodiscard]] const Scene& scene() const { return scene_; }
  [[nodiscard]] const ProjectCounts& projected() const { return projector_.counts(); }
  [[nodiscard]] std::int32_t first() const { return first_; }
  [[nodiscard]] std::int32_t last() const { return last_; }

 private:
  void mark(const ActiveBucket& bucket);
  void number();
  void triangulate();

  const Scene& scene_;
  ProjectSettings settings_;
  Kernel kernel_;
  SampleFeed feed_;
  Window window_;
  Projector projector_;
  std::int32_t first_, last_;
  std::vector<std::shared_ptr<const ActiveBucket>> buckets_;
  std::vector<std::shared_ptr<IsoSlab>> iso_;
  std::vector<FinalSlab> final_;
};

}  // namespace lamina::bench

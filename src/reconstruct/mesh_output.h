// The end of the pipeline: triangulated slabs are clustered, placed in the input's coordinates and written while the
// window goes on; holes are closed behind the last one.
#pragma once
#include <tbb/task_group.h>

#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "boundary/boundary.h"
#include "boundary/hole_closer.h"
#include "boundary/rim_fairing.h"
#include "boundary/rims.h"
#include "clustering/clusterer.h"
#include "clustering/crease_flips.h"
#include "clustering/settled_normals.h"
#include "isosurface/iso_mesh.h"
#include "lamina/frame.h"
#include "lamina/mesh_receiver.h"
#include "lamina/surface.h"
#include "meshes/distinct_positions.h"
#include "meshes/mesh_sink.h"

namespace lamina {

struct ReconstructionPlan;

/// A finished slab with what it refers to.
struct ClusteredSlab {
  const FinalSlab& slab;
  const IsoSlab& here;
  const IsoSlab* next;  ///< the one above, null at the end
};

/// A clustered vertex goes to its corner's projected point, moved outward by chord * curvature * cell^2 (at most a
/// quarter of a cell), which makes up for triangles cutting inside a curved surface. Behind the samples' attributes it
/// has those of plan.mesh_attributes that the run itself makes.
void place_vertices(const ClusteredSlab& slab, const ReconstructionPlan& plan, VertexBatch& out);

/// Where finished slabs go, in ascending order, by one thread at a time.
class SlabSink {
 public:
  SlabSink() = default;
  virtual ~SlabSink() = default;
  SlabSink(const SlabSink&) = delete;
  SlabSink& operator=(const SlabSink&) = delete;
  /// The slab's triangles name its vertices, and those of the slab before, by numbers from the first vertex written on.
  virtual void write(const MeshSlab& slab) = 0;
};

/// Where a whole mesh goes.
class WholeMesh : public SlabSink {
 public:
  /// Its files, to be read back before commit(); null where it goes elsewhere.
  virtual MeshSink* files() { return nullptr; }
  /// All slabs have come. Throws as MeshSink::commit() does.
  virtual void commit(const RunContext& run) = 0;
  [[nodiscard]] virtual std::uint64_t vertices() const = 0;
  [[nodiscard]] virtual std::uint64_t triangles() const = 0;
};

/// Its files, or where there is a receiver, that.
std::unique_ptr<WholeMesh> open_whole_mesh(const MeshSinkSettings& settings, MeshReceiver* receiver);

/// Slabs go in by ascending number; what comes out does not depend on when. With one thread everything happens inside
/// start().
class MeshOutput {
 public:
  /// The sink is the caller's; nobody else may write to it.
  MeshOutput(const ReconstructionPlan& plan, SlabSink& sink);
  /// Drops what is not written yet.
  ~MeshOutput();
  MeshOutput(const MeshOutput&) = delete;
  MeshOutput& operator=(const MeshOutput&) = delete;

  /// Hands over the next slab; the caller must not touch it again.
  void push(std::shared_ptr<IsoSlab> slab);
  /// Waits for what was started before, then starts on the slabs handed over since. Throws what the sink threw.
  void start();
  /// Works off the slabs handed over since and waits: all that they decide is in the sink when this returns.
  void wait();
  /// Everything is in the sink when this returns: no more slabs come.
  void finish();
  /// An empty slab, with the storage of one that was written where there is any, but for its triangles.
  std::shared_ptr<IsoSlab> spare();
  /// The storage of a written slab's triangles where there is any: a slab gets its own two slabs later than the rest.
  std::vector<IsoTriangle> spare_triangles();
  /// Written so far; at any time.
  [[nodiscard]] std::uint64_t vertices() const { return written_; }
  [[nodiscard]] std::uint64_t triangles() const { return triangles_; }
  /// After finish().
  [[nodiscard]] const ClusterCounts& counts() const { return clusterer_.counts(); }

 private:
  void work(std::vector<std::shared_ptr<IsoSlab>> slabs, bool last);
  void hand_to_rims(MeshSlab& slab);
  void trim(bool last);
  void settle(MeshSlab& slab);
  void pass_on(MeshSlab& slab);

  const ReconstructionPlan& plan_;
  SlabSink& sink_;
  Clusterer clusterer_;
  std::vector<std::shared_ptr<IsoSlab>> queued_;
  std::deque<std::shared_ptr<IsoSlab>> clustered_;  ///< by the clusterer, not yet written
  FinalSlab done_;                                  ///< lent to the clusterer and back: its storage is kept
  MeshSlab mesh_;                                   ///< of `done_`
  std::optional<CreaseFlips> flips_;                ///< where there are creases
  /// What makes the rims.
  struct Rims {
    RimSmoother smoother;
    RimTrimmer trimmer;
    RimFairer fairer;
  };
  std::optional<Rims> rims_;
  std::optional<NormalSettler> settler_;  ///< where normals are settled
  MeshSlab trimmed_, faired_;
  DistinctPositions distinct_;
  std::mutex mutex_;  ///< of the spares
  std::vector<std::shared_ptr<IsoSlab>> spares_;
  std::vector<std::vector<IsoTriangle>> triangle_spares_;
  std::atomic<std::uint64_t> written_ = 0, triangles_ = 0;
  tbb::task_group tasks_;
};

/// Passes slabs on and watches for rims.
class ClosingSlabs final : public SlabSink {
 public:
  /// `mesh`: the file the slabs go to.
  ClosingSlabs(const HoleSettings& settings, const MeshSinkSettings& mesh, SlabSink& to)
      : closer_(settings, mesh.attributes.size(), mesh.double_positions), to_(to) {}
  void write(const MeshSlab& slab) override;
  /// All slabs have come: what is to be added to the mesh.
  boundary::Addition finish();
  [[nodiscard]] const HoleStats& stats() const { return closer_.stats(); }

 private:
  boundary::BoundaryFinder finder_;
  boundary::HoleCloser closer_;
  boundary::BoundaryBatch boundary_;
  std::uint64_t vertices_ = 0;
  SlabSink& to_;
};

/// Adds to the mesh, which has all slabs, what closes its holes.
HoleStats close_holes(ClosingSlabs& slabs, SlabSink& mesh);

}  // namespace lamina

// The steps of a slab in the clusterer, in their order, and what it notes about each slab of its window beside the
// slab's own arrays: a slab is laid out and counted, its clusters are decided while most pass a fast test on their sums
// and the rest the exact one, and at last its vertices get their numbers and its triangles leave.
#pragma once
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "clustering/clusterer.h"
#include "isosurface/iso_mesh.h"
#include "lamina/error.h"

namespace lamina::clustering {

/// Name of an isovertex or a corner inside the window: its slab modulo 8 in the top bits, its index below.
using Ref = std::uint32_t;
inline constexpr int kRefShift = 29;
inline constexpr Ref kRefIndex = (1U << kRefShift) - 1;
inline constexpr std::size_t kWindowSlabs = 8;
inline constexpr std::uint32_t kNone = ~0U;

inline Ref slab_tag(std::int64_t slab) {
  return static_cast<Ref>(static_cast<std::uint64_t>(slab) % kWindowSlabs) << kRefShift;
}

struct VertexNote {
  static constexpr std::uint8_t kUsed = 1;        ///< a triangle names it
  static constexpr std::uint8_t kThree = 2;       ///< one of its triangles lies in three clusters
  static constexpr std::uint8_t kUnresolved = 4;  ///< its cluster is not resolved yet
  std::uint32_t corner = 0;  ///< the cluster's corner, SlabIndex bits relative to the vertex's slab
  union {                    // clusters are classified long before their vertices are numbered
    Ref balance = 0;         ///< every neighbour once as successor, once as predecessor, by XOR: 0 unless on a boundary
    std::uint32_t number;    ///< of a used vertex in the final mesh
  };
  std::uint8_t marks = 0;
  std::uint8_t direction = 0;   ///< from the corner to the vertex: 2 * axis + (0 up, 1 down)
  std::uint16_t component = 0;  ///< which connected component of an unresolved cluster

  [[nodiscard]] bool used() const { return (marks & kUsed) != 0; }
  [[nodiscard]] bool crossing() const { return (corner & SlabIndex::kNextSlab) != 0; }
};

/// Sums over a cluster's triangles. All are free of order.
struct CornerNote {
  static constexpr std::uint8_t kBeyond =
      0x80;                          ///< on a boundary, or two members in one direction: these sums do not tell
  std::uint64_t ring = 0;            ///< one bit per neighbour cluster met on the ring, by its `slot`
  std::uint16_t ring_triangles = 0;  ///< triangles in three clusters
  std::uint16_t edges = 0;           ///< between members, one bit per pair of directions
  std::uint8_t inner_triangles = 0;  ///< all three vertices are members
  std::uint8_t members = 0;          ///< used isovertices, one bit per direction, and kBeyond
  std::uint8_t idle = 0;             ///< members without a triangle in three clusters
  std::uint8_t slot = 0;             ///< the corner's place in a 4 x 4 x 4 tiling of the lattice: neighbours differ
};

enum class Verdict : std::uint8_t {
  absent,      ///< no vertex in the final mesh
  corner,      ///< collapses to one vertex
  kept,        ///< its isovertices stay
  split,       ///< several components, at least one collapses: see UnresolvedCluster::components
  unresolved,  ///< not decided yet
};

struct ClusterTriangle {
  std::array<Ref, 3> vertex;
};

/// One connected component of an unresolved cluster.
struct Component {
  bool collapses = false;
  std::array<float, 3> position{};
  std::uint32_t number = kNone;
};

/// A cluster the fast test does not accept, with the triangles that touch it.
struct UnresolvedCluster {
  std::uint32_t corner = 0;
  std::uint32_t first = 0, count = 0;  ///< range of SlabRecord::unresolved_triangles
  std::vector<Component> components;   ///< in order of their smallest isovertex
};

struct SlabRecord {
  std::int64_t slab = 0;
  std::shared_ptr<const IsoSlab> iso;
  std::vector<VertexNote> vertices;  ///< parallel to iso->vertices
  std::vector<CornerNote> corners;   ///< parallel to iso->corners, until these are classified
  std::vector<Verdict> verdicts;     ///< parallel to iso->corners
  std::vector<std::uint8_t> vetoes;  ///< parallel to iso->corners: condition Q fails beside an unresolved cluster
  std::vector<std::uint32_t>
      seats;  ///< parallel: index into `unresolved` while unresolved or split, else the final number
  std::uint32_t next_corners = 0;       ///< corners of the next slab that vertices name are less than this
  std::vector<std::uint32_t> crossing;  ///< vertices that belong to a corner of the next slab
  std::vector<IsoTriangle> border;      ///< triangles that touch the next slab, by a vertex or by its cluster
  std::vector<UnresolvedCluster> unresolved;
  std::vector<ClusterTriangle> unresolved_triangles;
};

/// A ring of slab records; those of the last eight slabs are valid.
struct Window {
  std::array<SlabRecord, kWindowSlabs> records;

  SlabRecord& at(std::int64_t slab) { return records[slab_tag(slab) >> kRefShift]; }
  [[nodiscard]] const SlabRecord& at(std::int64_t slab) const { return records[slab_tag(slab) >> kRefShift]; }
  VertexNote& vertex(Ref ref) { return records[ref >> kRefShift].vertices[ref & kRefIndex]; }
  [[nodiscard]] const VertexNote& vertex(Ref ref) const { return records[ref >> kRefShift].vertices[ref & kRefIndex]; }
  /// The corner a vertex belongs to.
  [[nodiscard]] Ref corner_of(Ref ref) const {
    const std::uint32_t corner = vertex(ref).corner;
    const Ref tag = ((ref >> kRefShift) + (corner >> 31)) % kWindowSlabs;
    return (tag << kRefShift) | (corner & ~SlabIndex::kNextSlab);
  }
  [[nodiscard]] const SlabRecord& record_of(Ref ref) const { return records[ref >> kRefShift]; }
  SlabRecord& record_of(Ref ref) { return records[ref >> kRefShift]; }
};

/// A defect of the stage before: says which slab and what.
[[noreturn]] inline void bad_slab(std::int64_t slab, const std::string& what) {
  throw Error(ExitCode::internal, "clustering: surface slab " + std::to_string(slab) + ": " + what +
                                      "; this is a defect of the program, please report it with the command line");
}

// Index ranges are split over threads; what is computed per chunk is joined in chunk order, or does not depend on
// order.

/// As many chunks as threads can use, each of at least `least` items.
inline std::size_t chunk_count(std::size_t items, std::size_t least) {
  const auto threads = static_cast<std::size_t>(std::max(1, tbb::this_task_arena::max_concurrency()));
  const std::size_t wanted = threads == 1 ? 1 : 4 * threads;
  return std::clamp<std::size_t>(items / least, 1, wanted);
}

/// Calls fn(chunk, begin, end) for each chunk of [0, items).
template <class Fn>
void for_chunks(std::size_t items, std::size_t chunks, const Fn& fn) {
  const auto begin_of = [&](std::size_t chunk) { return items * chunk / chunks; };
  if (chunks == 1) {
    fn(std::size_t{0}, std::size_t{0}, items);
    return;
  }
  tbb::parallel_for(std::size_t{0}, chunks,
                    [&](std::size_t chunk) { fn(chunk, begin_of(chunk), begin_of(chunk + 1)); });
}

/// Fills a fresh record for `iso`: the cluster of each vertex and the slot of each corner.
/// Throws Error(internal) where an index leaves this slab's corners.
void lay_out(SlabRecord& record, std::shared_ptr<const IsoSlab> iso);

/// Counts the triangles of `slab` into the notes of `slab` and the next one, and lists its border triangles.
/// Throws Error(internal) where an index leaves the tables of the two slabs.
void count_triangles(Window& window, std::int64_t slab, ClusterMode mode);

/// Once `slab` and the one below are counted: accepts the clusters of `slab` whose sums prove them safe, gathers the
/// triangles of all others (the unresolved ones), splits these into components, and vetoes accepted neighbours (of the
/// slab below, this one and the next) that would meet one of their vertices twice. The record of slab + 1 must be laid
/// out.
void classify(Window& window, std::int64_t slab);

/// Once `slab` + 1 is classified: final verdicts for all clusters of `slab`.
void decide(Window& window, std::int64_t slab);

/// The shape of a cluster with at most one member per direction, read from a few bits. For a cluster away from
/// boundaries: true when
/// - its induced complex is contractible (condition C), and
/// - no neighbour that fulfils C and R can fail Q because of it. That would need a vertex x met twice on the
///   neighbour's ring; between the two visits the ring walks through members whose triangles all lie in the two
///   clusters, and as the complex is contractible, removing x cuts these off as a component of idle members only.
///   Without such an x: true.
bool plain_shape(const CornerNote& note);

/// Once the clusters of `slab` and the next one are decided: numbers the final vertices of `slab` from `next_number`
/// on, and writes them with the surviving triangles: the border triangles of the slab below, then the others of this
/// slab. Throws Error(budget) when the numbers run out.
void number(Window& window, std::int64_t slab, std::uint64_t& next_number, FinalSlab& out, ClusterCounts& counts);

}  // namespace lamina::clustering

// Cells that need more than the case table: the loops of any leaf cell, whatever its neighbours' levels, and their
// triangles (docs/method.md, "Extraction across levels"). Plain cells at the surface's boundary come here, too.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "isosurface/extract.h"
#include "isosurface/loops.h"
#include "octree/window.h"

namespace lamina {

/// A crossing minimal edge on the surface of a cell.
struct CellCrossing {
  std::uint64_t key = 0;  ///< as in LoopTracer
  int level = 0;
  int axis = 0;
  Cell low;  ///< lower corner, in cells of `level`
};

/// Resolves one cell after the other; the results stand until the next.
class GeneralCell {
 public:
  explicit GeneralCell(BlockCache& cache) : cache_(&cache) {}

  void resolve(int level, const Cell& cell);

  /// Parallel to tracer().keys().
  [[nodiscard]] const std::vector<CellCrossing>& crossings() const { return crossings_; }
  [[nodiscard]] const LoopTracer& tracer() const { return tracer_; }
  /// The cell's closed faces that contain a crossing (LoopPoint::faces).
  [[nodiscard]] std::uint8_t faces(const CellCrossing& c) const;

 private:
  void walk_face(int level, int axis, int end, const Cell& low);
  void walk_edge(int level, int axis, const Cell& low, bool forward);
  [[nodiscard]] bool edge_is_divided(int level, int axis, const Cell& low);

  BlockCache* cache_;
  int level_ = 0;
  Cell cell_;
  LoopTracer tracer_;
  std::vector<CellCrossing> crossings_;
  std::vector<FaceCrossing> cycle_;
  bool known_ = true;
};

/// Triangles of a run of tiles before they are joined: centre vertices are numbered from 0 within the run.
struct TriangleRun {
  static constexpr std::uint32_t kCentre = 0x40000000U;  ///< bit of a triangle's index into `centres`
  std::vector<IsoTriangle> triangles;
  std::vector<IsoVertex> centres;
  ExtractCounts counts;
};

/// One thread's.
class CellEmitter {
 public:
  CellEmitter(BlockCache& cache, std::int32_t slab, IsoSlab& here, IsoSlab& next)
      : cache_(&cache), slab_(slab), here_(&here), next_(&next), cell_(cache) {}

  /// Appends the cell's triangles and notes at its isovertices where it has none. False when no surface passes.
  bool emit(int level, const Cell& cell, TriangleRun& run);

  /// A loop of the case table in a cell of a level: its isovertices and the middles of their edges.
  struct PlainLoop {
    int level = 0;
    Cell cell;
    std::span<const SlabIndex> vertices;
    std::span<const LoopPoint> outline;
  };
  /// Appends the loop's triangles along the sharp edges that pass it; false where none does, and the table's will do.
  bool emit_creased(const PlainLoop& loop, TriangleRun& run);

 private:
  struct Point {
    SlabIndex vertex;
    LoopPoint geometry;
    bool accepted = false;
  };
  [[nodiscard]] IsoVertex& vertex(SlabIndex i) const {
    return i.next() ? next_->vertices[i.index()] : here_->vertices[i.index()];
  }
  [[nodiscard]] Point locate(const CellCrossing& c, const std::array<std::int32_t, 3>& origin);
  void emit_loop(const std::array<std::int32_t, 3>& origin, TriangleRun& run);
  [[nodiscard]] LoopSeat seat(SlabIndex at, const std::array<std::int32_t, 3>& origin) const;
  bool cut(const std::array<std::int32_t, 3>& origin);
  [[nodiscard]] IsoVertex centre(const std::array<std::int32_t, 3>& origin) const;
  void note_quadrants(int level, const Cell& cell, const CellCrossing& c, SlabIndex i, bool covered) const;

  BlockCache* cache_;
  std::int32_t slab_;
  IsoSlab* here_;
  IsoSlab* next_;
  GeneralCell cell_;
  int level_ = 0;
  std::vector<Point> points_;
  std::vector<Point> loop_;
  std::vector<LoopPoint> outline_;
  std::vector<LoopSeat> seats_;
  std::vector<std::array<std::uint8_t, 3>> cut_;
};

}  // namespace lamina

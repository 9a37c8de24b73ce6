// Triangles of cells that need more than the case table: general cells, and plain ones at the surface's boundary.
#pragma once
#include <vector>

#include "isosurface/extract.h"
#include "isosurface/general_cell.h"

namespace lamina {

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
  std::vector<std::array<std::uint8_t, 3>> cut_;
};

}  // namespace lamina

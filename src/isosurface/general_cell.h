// The loops of any leaf cell, whatever its neighbours' levels (DESIGN rule of docs/method.md, "Extraction across
// levels").
#pragma once
#include <vector>

#include "isosurface/loops.h"
#include "octree/block_cache.h"

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

  [[nodiscard]] const std::vector<CellCrossing>& crossings() const {
    return crossings_;
  }  ///< parallel to tracer().keys()
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

}  // namespace lamina

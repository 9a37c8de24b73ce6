// Corners that several levels hold.
#pragma once
#include "octree/window.h"

namespace lamina {

/// A corner in a finer level.
struct FinerCorner {
  int level;
  Cell corner;
  const CornerBlock* block;
  int offset;
};

/// In the next finer level that holds the corner; the block is null where none does. Levels in between need not hold
/// it: a leaf cell may lie beside one that is subdivided twice there.
FinerCorner finer_corner(const Window& window, int level, Cell corner);

}  // namespace lamina

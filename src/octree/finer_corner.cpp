#include "octree/finer_corner.h"

namespace lamina {

FinerCorner finer_corner(const Window& window, int level, Cell corner) {
  while (level-- > 0) {
    corner = {corner.x * 2, corner.y * 2, corner.z * 2};
    const CornerBlock* block = window.probe(level, block_of(corner));
    const int offset = offset_in_block(corner);
    if (block != nullptr && block->corners.test(offset)) return {level, corner, block, offset};
  }
  return {-1, corner, nullptr, 0};
}

}  // namespace lamina

#include "vdb/sign_tiles.h"

#include <vector>

#include "vdb/streamed_vdb.h"
#include "vdb/tile_signs.h"

namespace lamina::volume {

using namespace openvdb;

void sign_tiles(FloatGrid& grid) {
  std::vector<LeafVotes> votes;
  for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf) {
    const Coord o = leaf->origin();
    votes.push_back({{o[0] >> 3, o[1] >> 3, o[2] >> 3}, face_votes(*leaf)});
  }
  const TileSigns signs(votes);
  auto tile = grid.tree().beginValueOff();
  tile.setMaxDepth(FloatTree::ValueOffIter::LEAF_DEPTH - 1);
  for (; tile; ++tile) {
    const Coord o = tile.getCoord();
    const TileSigns::Place node{o[0] >> 7, o[1] >> 7, o[2] >> 7};
    bool inside = signs.inside(node);
    if (tile.getLevel() == 1) {
      const std::uint8_t* const tiles = signs.inside_tiles(node);
      const int slot = ((o[0] >> 3 & 15) * 16 + (o[1] >> 3 & 15)) * 16 + (o[2] >> 3 & 15);
      inside = tiles != nullptr && tiles[slot] != 0;
    }
    tile.setValue(inside ? -grid.background() : grid.background());
  }
}

}  // namespace lamina::volume

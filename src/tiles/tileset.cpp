#include "tiles/tileset.h"

#include <algorithm>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <utility>

namespace lamina::tiles {
namespace {

using meshes::Vec3;
using TilesetJson = nlohmann::ordered_json;

/// Boxes of all that is in a tile and below it, children before parents.
std::vector<StepBox> whole_boxes(const Tileset& tileset) {
  std::vector<StepBox> boxes;
  for (const TileEntry& entry : tileset.entries) boxes.push_back(entry.box);
  for (std::size_t node = boxes.size(); node-- > 1;) {
    if (tileset.entries[node].triangles == 0) continue;
    StepBox& above = boxes[tileset.octree.nodes()[node].parent];
    for (std::size_t k = 0; k < 3; ++k) {
      above.low[k] = std::min(above.low[k], boxes[node].low[k]);
      above.high[k] = std::max(above.high[k], boxes[node].high[k]);
    }
  }
  return boxes;
}

/// Middle and half axes.
TilesetJson box_json(const StepBox& box, double step) {
  TilesetJson out = TilesetJson::array();
  for (std::size_t k = 0; k < 3; ++k) out.push_back(step * 0.5 * (box.low[k] + box.high[k]));
  for (std::size_t k = 0; k < 3; ++k) {
    // A flat tile has a thickness all the same: half a step.
    Vec3 axis{};
    axis[k] = step * 0.5 * std::max(1.0, box.high[k] - box.low[k]);
    for (const double c : axis) out.push_back(c);
  }
  return {{"box", std::move(out)}};
}

TilesetJson tile_json(const Tileset& tileset, const std::vector<StepBox>& boxes, std::uint32_t node) {
  const TileEntry& entry = tileset.entries[node];
  const double step = tileset.lattice.step;
  TilesetJson tile;
  tile["boundingVolume"] = box_json(boxes[node], step);
  tile["geometricError"] = step * entry.error;
  if (node == 0) tile["refine"] = "REPLACE";
  tile["content"] = {{"uri", entry.content}};
  tile["extras"] = {{"triangles", entry.triangles}};
  TilesetJson children = TilesetJson::array();
  for (const std::uint32_t child : tileset.octree.nodes()[node].children) {
    if (tileset.entries[child].triangles > 0) children.push_back(tile_json(tileset, boxes, child));
  }
  if (!children.empty()) tile["children"] = std::move(children);
  return tile;
}

}  // namespace

std::string tileset_json(const Tileset& tileset) {
  const std::vector<StepBox> boxes = whole_boxes(tileset);
  const Vec3& origin = tileset.lattice.origin;
  TilesetJson json;
  json["asset"] = {{"version", "1.1"}};
  json["asset"]["extras"] = {{"generator", "lamina " LAMINA_VERSION}, {"origin", origin}};
  if (!tileset.crs.empty()) json["asset"]["extras"]["crs"] = tileset.crs;
  // From this far off nothing of it is to be seen.
  Vec3 diagonal{};
  for (std::size_t k = 0; k < 3; ++k) diagonal[k] = tileset.lattice.step * (boxes[0].high[k] - boxes[0].low[k]);
  json["geometricError"] = std::max(meshes::norm(diagonal), tileset.lattice.step * tileset.entries[0].error);
  json["root"] = tile_json(tileset, boxes, 0);
  const Matrix4 local{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, origin[0], origin[1], origin[2], 1};
  json["root"]["transform"] = tileset.plane ? to_earth(*tileset.plane, origin) : local;
  return json.dump(-1, ' ', false, TilesetJson::error_handler_t::replace) + "\n";
}

TileStats stats_of(const Tileset& tileset) {
  TileStats stats;
  for (std::size_t node = 0; node < tileset.entries.size(); ++node) {
    const TileEntry& entry = tileset.entries[node];
    if (entry.triangles == 0) continue;
    ++stats.tiles;
    stats.bytes += entry.bytes;
    stats.levels = std::max(stats.levels, tileset.octree.nodes()[node].depth + 1);
    if (!tileset.octree.nodes()[node].leaf()) continue;
    ++stats.leaves;
    stats.triangles += entry.triangles;
  }
  stats.error = tileset.lattice.step * tileset.entries[0].error;
  stats.on_earth = tileset.plane.has_value();
  return stats;
}

}  // namespace lamina::tiles

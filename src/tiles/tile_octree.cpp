#include "tiles/tile_octree.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "lamina/error.h"
#include "lamina/mesh.h"
#include "meshes/block_passes.h"

namespace lamina::tiles {
namespace {

using meshes::Vec3;

/// The digit of a place at a depth: which eighth of the cell above it is in.
std::uint32_t octant(const std::array<std::uint32_t, 3>& place, int bit) {
  return (place[0] >> bit & 1U) | (place[1] >> bit & 1U) << 1U | (place[2] >> bit & 1U) << 2U;
}

}  // namespace

double Extent::longest() const {
  return std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
}

Vec3 Extent::middle() const {
  return {low[0] + 0.5 * (high[0] - low[0]), low[1] + 0.5 * (high[1] - low[1]), low[2] + 0.5 * (high[2] - low[2])};
}

Extent extent_of(meshes::MeshBlocks& mesh) {
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  Extent box;
  box.low.fill(kInfinite);
  box.high.fill(-kInfinite);
  std::uint64_t vertex = 0;
  meshes::for_vertices(mesh, [&](const TriangleMesh& block, std::size_t v) {
    for (std::size_t k = 0; k < 3; ++k) {
      const double c = block.positions[v][k];
      if (!std::isfinite(c)) {
        throw Error(ExitCode::unreadable,
                    fmt::format("tiles: vertex {} of the mesh has a coordinate that is not finite", vertex));
      }
      box.low[k] = std::min(box.low[k], c);
      box.high[k] = std::max(box.high[k], c);
    }
    ++vertex;
  });
  return box;
}

TileOctree::TileOctree(meshes::MeshBlocks& mesh, const Extent& extent, std::uint64_t most)
    : extent_(extent), most_(std::max<std::uint64_t>(most, 1)) {
  const double side = extent.longest();
  scale_ = side > 0 ? std::ldexp(1, kDeepest) / side : 0;
  cells_.emplace_back();
  cells_[0].vertices = mesh.vertices();
  // A surface has four times as many cells a level; the last ones counted are to be a small part of a tile.
  const double parts = 64 * static_cast<double>(mesh.vertices()) / static_cast<double>(most_);
  int levels = std::clamp(static_cast<int>(std::ceil(std::log2(std::max(parts, 1.0)) / 2)), 1, 10);
  while (count_and_split(mesh, levels)) levels = 3;
  nodes_.emplace_back();
  nodes_[0].name = "0";
  make_tiles(0, 0);
}

std::array<std::uint32_t, 3> TileOctree::place(const Vec3& at) const {
  std::array<std::uint32_t, 3> out{};
  constexpr double kLast = (1U << kDeepest) - 1;
  for (std::size_t k = 0; k < 3; ++k)
    out[k] = static_cast<std::uint32_t>(std::clamp(std::floor((at[k] - extent_.low[k]) * scale_), 0.0, kLast));
  return out;
}

std::uint32_t TileOctree::cell_at(const std::array<std::uint32_t, 3>& place) const {
  std::uint32_t cell = 0;
  while (cells_[cell].split) {
    const std::uint32_t next = cells_[cell].child[octant(place, kDeepest - 1 - cells_[cell].depth)];
    if (next == 0) return cell;  // no vertex was counted there
    cell = next;
  }
  return cell;
}

/// Returns whether cells are left that have too many.
bool TileOctree::count_and_split(meshes::MeshBlocks& mesh, int levels) {
  std::vector<std::unordered_map<std::uint64_t, std::uint64_t>> counts(cells_.size());
  const auto too_many = [&](const Cell& cell) { return !cell.split && cell.vertices > most_ && cell.depth < kDeepest; };
  if (std::none_of(cells_.begin(), cells_.end(), too_many)) return false;
  meshes::for_vertices(mesh, [&](const TriangleMesh& block, std::size_t v) {
    const auto where = place(block.positions[v]);
    const std::uint32_t cell = cell_at(where);
    if (!too_many(cells_[cell])) return;
    std::uint64_t key = 0;
    for (int level = 0; level < levels; ++level) {
      const int bit = kDeepest - 1 - cells_[cell].depth - level;
      key = key << 3U | (bit >= 0 ? octant(where, bit) : 0);
    }
    ++counts[cell][key];
  });
  for (std::uint32_t cell = 0; cell < counts.size(); ++cell) {
    if (counts[cell].empty()) continue;
    std::vector<Counted> sorted;
    for (const auto& [key, vertices] : counts[cell]) sorted.push_back({key, vertices});
    std::sort(sorted.begin(), sorted.end(), [](const Counted& a, const Counted& b) { return a.key < b.key; });
    split(cell, sorted.data(), sorted.data() + sorted.size(), levels);
  }
  return std::any_of(cells_.begin(), cells_.end(), too_many);
}

/// Of what was counted `levels` below the cell.
void TileOctree::split(std::uint32_t cell, const Counted* begin, const Counted* end, int levels) {
  if (cells_[cell].vertices <= most_ || levels == 0 || cells_[cell].depth == kDeepest) return;
  cells_[cell].split = true;
  const auto shift = static_cast<unsigned>(3 * (levels - 1));
  for (const Counted* from = begin; from != end;) {
    const std::uint64_t digit = from->key >> shift & 7U;
    const Counted* to = from;
    std::uint64_t vertices = 0;
    for (; to != end && (to->key >> shift & 7U) == digit; ++to) vertices += to->vertices;
    const auto child = static_cast<std::uint32_t>(cells_.size());
    cells_[cell].child[digit] = child;
    Cell below;
    below.vertices = vertices;
    below.depth = cells_[cell].depth + 1;
    cells_.push_back(below);
    split(child, from, to, levels - 1);
    from = to;
  }
}

std::uint32_t TileOctree::add_node(std::uint32_t parent, int digit) {
  const auto number = static_cast<std::uint32_t>(nodes_.size());
  TileNode node;
  node.parent = parent;
  node.depth = nodes_[parent].depth + 1;
  node.name = nodes_[parent].name + static_cast<char>('0' + digit);
  nodes_.push_back(std::move(node));
  nodes_[parent].children.push_back(number);
  return number;
}

/// The tiles of a cell below a node that stands for it.
void TileOctree::make_tiles(std::uint32_t cell, std::uint32_t node) {
  const double side = extent_.longest();
  while (cells_[cell].split) {  // a cell with one child is that child
    const auto& child = cells_[cell].child;
    if (std::count(child.begin(), child.end(), 0U) != 7) break;
    cells_[cell].tile = node;
    cell = *std::find_if(child.begin(), child.end(), [](std::uint32_t c) { return c != 0; });
  }
  cells_[cell].tile = node;
  if (!cells_[cell].split) {
    nodes_[node].side = std::ldexp(side, -cells_[cell].depth);
    return;
  }
  // Leaves side by side are filled up to `most_`.
  std::vector<std::vector<std::uint32_t>> tiles;
  std::uint64_t filled = 0;
  std::size_t open = tiles.max_size();
  const std::array<std::uint32_t, 8> child = cells_[cell].child;
  for (const std::uint32_t c : child) {
    if (c == 0) continue;
    const bool leaf = !cells_[c].split;
    if (leaf && open < tiles.size() && filled + cells_[c].vertices <= most_) {
      tiles[open].push_back(c);
      filled += cells_[c].vertices;
      continue;
    }
    tiles.push_back({c});
    if (!leaf) continue;
    open = tiles.size() - 1;
    filled = cells_[c].vertices;
  }
  for (std::size_t t = 0; t < tiles.size(); ++t) {
    const std::uint32_t below = add_node(node, static_cast<int>(t));
    if (tiles[t].size() == 1) {
      make_tiles(tiles[t][0], below);
      continue;
    }
    for (const std::uint32_t c : tiles[t]) cells_[c].tile = below;
    nodes_[below].side = std::ldexp(side, -cells_[cell].depth);
  }
}

std::uint32_t TileOctree::leaf_at(const Vec3& at) const {
  return cells_[cell_at(place(at))].tile;
}

std::uint32_t TileOctree::common(std::uint32_t a, std::uint32_t b) const {
  while (a != b) {
    std::uint32_t& deeper = nodes_[a].depth >= nodes_[b].depth ? a : b;
    deeper = nodes_[deeper].parent;
  }
  return a;
}

}  // namespace lamina::tiles

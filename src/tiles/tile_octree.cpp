#include "tiles/tile_octree.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <unordered_map>

#include "lamina/error.h"
#include "lamina/mesh.h"
#include "meshes/mesh_blocks.h"

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

TileOctree::TileOctree(meshes::MeshBlocks& mesh, const Extent& extent, std::uint64_t wanted) : extent_(extent) {
  constexpr std::uint64_t kCells = 64;  // in a tile
  most_ = std::max<std::uint64_t>(wanted / kCells, 1);
  const double side = extent.longest();
  scale_ = side > 0 ? std::ldexp(1, kDeepest) / side : 0;
  cells_.emplace_back();
  cells_[0].vertices = mesh.vertices();
  // A surface has four times as many cells a level.
  const double parts = static_cast<double>(mesh.vertices()) / static_cast<double>(most_);
  int levels = std::clamp(static_cast<int>(std::ceil(std::log2(std::max(parts, 1.0)) / 2)), 1, 10);
  while (count_and_split(mesh, levels)) levels = 3;
  std::vector<Filled> filled;
  list_cells(0, {}, filled);
  const auto leaves = std::llround(static_cast<double>(mesh.vertices()) / static_cast<double>(wanted));
  nodes_.emplace_back();
  nodes_[0].name = "0";
  make_tiles({filled, static_cast<std::uint64_t>(std::max(leaves, 1LL))}, 0);
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
  // Vertices that follow each other mostly lie in one cell.
  Counted run{};
  std::uint32_t cell_of_run = 0;
  const auto end_run = [&] {
    if (run.vertices > 0) counts[cell_of_run][run.key] += run.vertices;
    run.vertices = 0;
  };
  meshes::for_vertices(mesh, [&](const TriangleMesh& block, std::size_t v) {
    const auto where = place(block.positions[v]);
    const std::uint32_t cell = cell_at(where);
    if (!too_many(cells_[cell])) return;
    std::uint64_t key = 0;
    for (int level = 0; level < levels; ++level) {
      const int bit = kDeepest - 1 - cells_[cell].depth - level;
      key = key << 3U | (bit >= 0 ? octant(where, bit) : 0);
    }
    if (key != run.key || cell != cell_of_run) end_run();
    run.key = key;
    cell_of_run = cell;
    ++run.vertices;
  });
  end_run();
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

void TileOctree::list_cells(std::uint32_t cell, const std::array<double, 3>& low, std::vector<Filled>& out) const {
  const Cell& here = cells_[cell];
  const double half = std::ldexp(0.5, kDeepest - here.depth);
  if (!here.split) {
    out.push_back({{low[0] + half, low[1] + half, low[2] + half}, half, here.vertices, cell});
    return;
  }
  for (std::size_t digit = 0; digit < here.child.size(); ++digit) {
    if (here.child[digit] == 0) continue;
    std::array<double, 3> corner = low;
    for (std::size_t k = 0; k < 3; ++k) corner[k] += (digit >> k & 1U) != 0 ? half : 0;
    list_cells(here.child[digit], corner, out);
  }
}

/// Cut in two across the longest side, `times` times or until nothing is left to be cut.
void TileOctree::share_out(const Lot& lot, int times, std::vector<Lot>& out) {
  if (times == 0 || lot.leaves == 1 || lot.cells.size() == 1) {
    out.push_back(lot);
    return;
  }
  std::array<double, 3> low = lot.cells[0].middle, high = low;
  std::uint64_t vertices = 0;
  for (const Filled& cell : lot.cells) {
    vertices += cell.vertices;
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], cell.middle[k] - cell.half);
      high[k] = std::max(high[k], cell.middle[k] + cell.half);
    }
  }
  std::size_t axis = 0;
  for (std::size_t k = 1; k < 3; ++k) {
    if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
  }
  std::sort(lot.cells.begin(), lot.cells.end(), [axis](const Filled& a, const Filled& b) {
    return std::tie(a.middle[axis], a.cell) < std::tie(b.middle[axis], b.cell);
  });
  const std::uint64_t lower = lot.leaves / 2;
  const double wanted = static_cast<double>(vertices) * static_cast<double>(lower) / static_cast<double>(lot.leaves);
  std::size_t count = 0;
  double below = 0;
  while (count + 1 < lot.cells.size() &&
         (count == 0 || below + 0.5 * static_cast<double>(lot.cells[count].vertices) < wanted))
    below += static_cast<double>(lot.cells[count++].vertices);
  share_out({lot.cells.first(count), lower}, times - 1, out);
  share_out({lot.cells.subspan(count), lot.leaves - lower}, times - 1, out);
}

/// A node with few leaves has all of them as children, others have four.
void TileOctree::make_tiles(const Lot& lot, std::uint32_t node) {
  constexpr std::uint64_t kMostLeaves = 8;
  constexpr int kToTheEnd = 4, kInFour = 2;
  if (lot.leaves == 1 || lot.cells.size() == 1) {
    std::array<double, 3> low = lot.cells[0].middle, high = low;
    for (const Filled& cell : lot.cells) {
      cells_[cell.cell].tile = node;
      for (std::size_t k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], cell.middle[k] - cell.half);
        high[k] = std::max(high[k], cell.middle[k] + cell.half);
      }
    }
    const double longest = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
    nodes_[node].side = scale_ > 0 ? longest / scale_ : 0;
    return;
  }
  std::vector<Lot> lots;
  share_out(lot, lot.leaves <= kMostLeaves ? kToTheEnd : kInFour, lots);
  for (std::size_t i = 0; i < lots.size(); ++i) make_tiles(lots[i], add_node(node, static_cast<int>(i)));
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

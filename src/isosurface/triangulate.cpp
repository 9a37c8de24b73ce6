#include "isosurface/extract.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "base/vectors.h"
#include "isosurface/cell_emitter.h"
#include "isosurface/loops.h"
#include "isosurface/tile_view.h"

namespace lamina {
namespace {

/// Tiles of a run: fixed, though the result does not depend on it.
constexpr std::size_t kRunTiles = 16;

/// case_table() with its edges as offsets into EdgeNumbers.
struct PlainCase {
  int count = 0;
  std::array<std::uint16_t, 3 * CaseTriangles::kMost> edges{};
  std::array<std::uint16_t, 12> loop_edges{};
  std::array<LoopPoint, 12> loop_points{};
};

std::uint16_t edge_offset(int edge) {
  const std::array<int, 3> low = edge_low_corner(edge);
  return static_cast<std::uint16_t>(EdgeNumbers::offset(edge / 4, low[0], low[1], low[2]));
}

PlainCase plain_case(const CaseTriangles& c) {
  PlainCase out;
  out.count = c.count;
  for (int k = 0; k < 3 * c.count; ++k) out.edges[k] = edge_offset(c.edges[k]);
  for (std::size_t k = 0; k < c.loop_edges.size(); ++k) {
    out.loop_edges[k] = edge_offset(c.loop_edges[k]);
    out.loop_points[k] = edge_middle(c.loop_edges[k]);
  }
  return out;
}

const std::array<PlainCase, 256>& plain_cases() {
  static const std::array<PlainCase, 256> cases = [] {
    std::array<PlainCase, 256> out;
    std::transform(case_table().begin(), case_table().end(), out.begin(), plain_case);
    return out;
  }();
  return cases;
}

/// Words of a mask at layer z in [0, 8] over the tile and its three neighbours at greater x or y.
struct Corner4 {
  std::uint64_t here = 0, right = 0, up = 0, up_right = 0;

  Corner4() = default;
  template <typename Word>  // of a block and a layer in it
  Corner4(const TileView& tile, int z, const Word& word) {
    const auto at = [&](int dx, int dy) {
      const CornerBlock* b = tile.neighbour(dx, dy, z >> 3);
      return b == nullptr ? std::uint64_t{0} : word(*b, z & 7);
    };
    here = at(0, 0);
    right = at(1, 0);
    up = at(0, 1);
    up_right = at(1, 1);
  }
  [[nodiscard]] std::uint64_t next_column() const { return bits::shift_x(0, here, right, -1); }
  [[nodiscard]] std::uint64_t next_row() const { return bits::shift_y(0, here, up, -1); }
  [[nodiscard]] std::uint64_t next_both() const {
    return bits::shift_x(0, next_row(), bits::shift_y(0, right, up_right, -1), -1);
  }
};

/// Cells of layer z with an edge of a kind: `edges` gives the words of an axis in a block.
template <typename Edges>
std::uint64_t cells_with(const TileView& tile, int z, const Edges& edges) {
  const auto words = [&](int axis, int layer) {
    return Corner4(tile, layer, [&](const CornerBlock& b, int in_block) { return edges(b, axis, in_block); });
  };
  std::uint64_t out = 0;
  for (int plane = z; plane <= z + 1; ++plane) {
    const Corner4 along_x = words(0, plane);
    const Corner4 along_y = words(1, plane);
    out |= along_x.here | along_x.next_row() | along_y.here | along_y.next_column();
  }
  const Corner4 upright = words(2, z);
  return out | upright.here | upright.next_column() | upright.next_row() | upright.next_both();
}

// No functions: these would be called through their address.
constexpr auto kValidEdges = [](const CornerBlock& b, int axis, int z) { return b.accepted[axis].words[z]; };
constexpr auto kInvalidEdges = [](const CornerBlock& b, int axis, int z) {
  return b.crossing[axis].words[z] & ~b.accepted[axis].words[z];
};

/// Signs of one plane of corners as a layer's cells need them: at (x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1).
struct Plane {
  std::array<std::uint64_t, 4> outside{};

  Plane() = default;
  Plane(const TileView& tile, int z) {
    const Corner4 c(tile, z, [](const CornerBlock& b, int layer) { return b.outside.words[layer]; });
    outside = {c.here, c.next_column(), c.next_row(), c.next_both()};
  }
};

/// Layers [begin, end] of the tile, and of its neighbours at greater x, y or z, in which a kind of edge occurs.
unsigned layers_with(const TileView& tile, std::uint8_t CornerBlock::*layers) {
  unsigned out = 0;
  for (int dz = 0; dz < 2; ++dz) {
    for (int dy = 0; dy < 2; ++dy) {
      for (int dx = 0; dx < 2; ++dx) {
        const CornerBlock* b = tile.neighbour(dx, dy, dz);
        if (b != nullptr) out |= static_cast<unsigned>(b->*layers) << (8 * dz);
      }
    }
  }
  return out & ((2U << tile.end) - (1U << tile.begin));
}

/// Cells with a subdivided one among their 18 face and edge neighbours.
std::uint64_t beside_split(const TileView& tile, int z) {
  const auto cross = [](const Slice& s) {
    return s.here() | s.at<1, 0>() | s.at<-1, 0>() | s.at<0, 1>() | s.at<0, -1>();
  };
  const Slice s(tile, &CornerBlock::split, z);
  const Slice below(tile, &CornerBlock::split, z - 1);
  const Slice above(tile, &CornerBlock::split, z + 1);
  if (!s.any() && !below.any() && !above.any()) return 0;
  return cross(s) | s.at<1, 1>() | s.at<1, -1>() | s.at<-1, 1>() | s.at<-1, -1>() | cross(below) | cross(above);
}

/// Cells with accepted edges in or around them.
std::uint64_t beside_busy(const TileView& tile, int z) {
  const auto around = [](const Slice& s) { return s.here() | s.at<1, 0>() | s.at<0, 1>() | s.at<1, 1>(); };
  return around(Slice(tile, &CornerBlock::busy, z)) | around(Slice(tile, &CornerBlock::busy, z + 1));
}

/// Cells with a corner whose vertex lies on a sharp edge.
std::uint64_t beside_creased(const TileView& tile, int z) {
  const auto word = [](const CornerBlock& b, int layer) { return b.creased.words[layer]; };
  const Corner4 below(tile, z, word);
  const Corner4 above(tile, z + 1, word);
  return below.here | below.next_column() | below.next_row() | below.next_both() | above.here | above.next_column() |
         above.next_row() | above.next_both();
}

class TilePass {
 public:
  TilePass(BlockCache& cache, std::int32_t slab, IsoSlab& here, IsoSlab& next, const std::array<PlainCase, 256>& cases)
      : lattice_(cache.window().lattice()), slab_(slab), cases_(&cases), emitter_(cache, slab, here, next) {}

  void run(const TileView& tile, TriangleRun& out) {
    if (layers_with(tile, &CornerBlock::busy_layers) == 0) return;  // no valid isovertex: nothing to emit
    const unsigned doubtful = layers_with(tile, &CornerBlock::doubtful_layers);
    const CornerBlock& leaf = tile.leaf();
    int loaded = tile.begin;  // layers of edges in numbers_
    Plane below(tile, tile.begin);
    for (int z = tile.begin; z < tile.end; ++z) {
      const Plane above(tile, z + 1);
      const std::uint64_t cells = leaf.cells.words[z];
      const std::uint64_t all = below.outside[0] & below.outside[1] & below.outside[2] & below.outside[3] &
                                above.outside[0] & above.outside[1] & above.outside[2] & above.outside[3];
      const std::uint64_t any = below.outside[0] | below.outside[1] | below.outside[2] | below.outside[3] |
                                above.outside[0] | above.outside[1] | above.outside[2] | above.outside[3];
      const std::uint64_t hanging = tile.level == 0 || cells == 0 ? 0 : cells & beside_split(tile, z);
      const std::uint64_t general = hanging == 0 ? 0 : hanging & beside_busy(tile, z);
      std::uint64_t mixed = cells & any & ~all & ~hanging;
      std::uint64_t partial = 0;
      if (mixed != 0 && (doubtful & (3U << z)) != 0) {
        // Most cells with an invalid isovertex have nothing else: the far ends of what samples reach.
        partial = mixed & cells_with(tile, z, kInvalidEdges);
        if (partial != 0) mixed &= ~partial | cells_with(tile, z, kValidEdges);
        partial &= mixed;
      }
      const std::uint64_t creased = (mixed & ~partial) == 0 ? 0 : mixed & ~partial & beside_creased(tile, z);
      if ((mixed & ~partial) != 0) {
        for (loaded = std::max(loaded, z); loaded <= z + 1; ++loaded) load_edges(tile, loaded);
      }
      emit_layer(tile, z, below, above, {general, mixed, partial, creased}, out);
      below = above;
    }
  }

 private:
  struct Kinds {
    std::uint64_t general, mixed;
    std::uint64_t partial;  ///< of the mixed ones those that the table does not serve
    std::uint64_t creased;  ///< and those whose loops it serves, but a sharp edge may pass them
  };

  void load_edges(const TileView& tile, int z) {
    const bool next = lattice_.slab_of_layer(tile.level, tile.block.z * 8 + z) != slab_;
    numbers_.load(tile, z, next ? SlabIndex::kNextSlab : 0, z < tile.end);
  }

  void emit_layer(const TileView& tile, int z, const Plane& below, const Plane& above, const Kinds& kinds,
                  TriangleRun& out) {
    const std::uint64_t special = kinds.general | kinds.partial;
    IsoTriangle* end = layer_.data();  // of the plain triangles since the last special cell
    const auto flush = [&] {
      out.triangles.insert(out.triangles.end(), layer_.data(), end);
      end = layer_.data();
    };
    for_bits(kinds.mixed | kinds.general, [&](int bit) {
      if (((special >> bit) & 1U) != 0) {
        flush();
        const bool crossing = emitter_.emit(tile.level, tile.cell(z * 64 + bit), out);
        out.counts.crossing_cells += crossing ? 1 : 0;
        out.counts.general_cells += crossing ? (kinds.general >> bit) & 1U : 0;
        return;
      }
      unsigned signs = 0;
      for (int i = 0; i < 4; ++i) {
        signs |= static_cast<unsigned>((below.outside[i] >> bit) & 1U) << i;
        signs |= static_cast<unsigned>((above.outside[i] >> bit) & 1U) << (i + 4);
      }
      const PlainCase& c = (*cases_)[signs];
      const int base = EdgeNumbers::offset(0, bit & 7, bit >> 3, z);
      if (((kinds.creased >> bit) & 1U) != 0) {
        flush();
        emit_creased(tile, z * 64 + bit, signs, out);
        return;
      }
      const auto triangle = [&](int t) {
        return IsoTriangle{SlabIndex{numbers_.at(base + c.edges[3 * t])},
                           SlabIndex{numbers_.at(base + c.edges[3 * t + 1])},
                           SlabIndex{numbers_.at(base + c.edges[3 * t + 2])}};
      };
      // Most have fewer, which are written over: how many is as good as random.
      constexpr int kAtOnce = CaseTriangles::kMost - 1;
      for (int t = 0; t < kAtOnce; ++t) end[t] = triangle(t);
      if (c.count > kAtOnce) end[kAtOnce] = triangle(kAtOnce);
      end += c.count;
    });
    out.counts.crossing_cells += static_cast<unsigned>(std::popcount(kinds.mixed & ~special));
    flush();
  }

  /// A cell that the table serves, loop by loop: along the sharp edge where one passes.
  void emit_creased(const TileView& tile, int offset, unsigned signs, TriangleRun& out) {
    const CaseTriangles& of = case_table()[signs];
    const PlainCase& c = (*cases_)[signs];
    const int base = EdgeNumbers::offset(0, offset & 7, (offset >> 3) & 7, offset >> 6);
    const auto vertex = [&](std::uint16_t edge) { return SlabIndex{numbers_.at(base + edge)}; };
    std::array<SlabIndex, 12> vertices;
    std::size_t first = 0;  // edge of the loop
    std::size_t done = 0;   // indices of its triangles
    for (std::size_t k = 0; k < of.loops; ++k) {
      const std::size_t n = of.loop_size[k];
      for (std::size_t i = 0; i < n; ++i) vertices[i] = vertex(c.loop_edges[first + i]);
      const std::span<const LoopPoint> outline(&c.loop_points[first], n);
      const std::size_t end = done + 3 * (n - 2);
      if (emitter_.emit_creased({tile.level, tile.cell(offset), {vertices.data(), n}, outline}, out)) {
        done = end;
      } else {
        for (; done < end; done += 3)
          out.triangles.push_back({vertex(c.edges[done]), vertex(c.edges[done + 1]), vertex(c.edges[done + 2])});
      }
      first += n;
    }
  }

  const Lattice& lattice_;
  std::int32_t slab_;
  const std::array<PlainCase, 256>* cases_;
  CellEmitter emitter_;
  EdgeNumbers numbers_;
  std::array<IsoTriangle, 64 * CaseTriangles::kMost> layer_;
};

/// Appends the runs in order; their centre vertices go behind the edges'.
void join(const std::vector<TriangleRun>& runs, IsoSlab& out, ExtractCounts& counts) {
  std::vector<std::size_t> first(runs.size() + 1, 0);
  std::vector<std::uint32_t> centre_base(runs.size());
  for (std::size_t i = 0; i < runs.size(); ++i) {
    first[i + 1] = first[i] + runs[i].triangles.size();
    centre_base[i] = static_cast<std::uint32_t>(out.vertices.size());
    out.vertices.insert(out.vertices.end(), runs[i].centres.begin(), runs[i].centres.end());
    counts.crossing_cells += runs[i].counts.crossing_cells;
    counts.general_cells += runs[i].counts.general_cells;
    counts.rejected_loops += runs[i].counts.rejected_loops;
  }
  resize_anew(out.triangles, first.back());
  tbb::parallel_for(std::size_t{0}, runs.size(), [&](std::size_t i) {
    const auto begin = out.triangles.begin() + static_cast<std::ptrdiff_t>(first[i]);
    const auto end = std::copy(runs[i].triangles.begin(), runs[i].triangles.end(), begin);
    if (runs[i].centres.empty()) return;
    for (auto t = begin; t != end; ++t) {
      for (SlabIndex& v : *t) {
        if (!v.next() && (v.bits & TriangleRun::kCentre) != 0)
          v.bits = (v.bits & ~TriangleRun::kCentre) + centre_base[i];
      }
    }
  });
}

}  // namespace

void triangulate(const Window& window, std::int32_t slab, IsoSlab& out, IsoSlab& next, ExtractCounts& counts) {
  const std::vector<TileView> views = slab_tiles(window, slab);
  using Parts = BlockParts<&CornerBlock::around, &CornerBlock::busy_layers, &CornerBlock::cells, &CornerBlock::outside,
                           &CornerBlock::accepted, &CornerBlock::numbers>;
  const std::array<PlainCase, 256>& cases = plain_cases();
  std::vector<TriangleRun> runs((views.size() + kRunTiles - 1) / kRunTiles);
  tbb::parallel_for(
      std::size_t{0}, runs.size(),
      [&](std::size_t r) {
        BlockCache cache(window);
        TilePass pass(cache, slab, out, next, cases);
        const std::size_t end = std::min(views.size(), (r + 1) * kRunTiles);
        for (std::size_t i = r * kRunTiles; i < end; ++i) {
          ask_ahead<Parts>(views, i);
          pass.run(views[i], runs[r]);
        }
      },
      window.affinity());
  join(runs, out, counts);
}

}  // namespace lamina

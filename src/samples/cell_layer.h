// One layer of cells of a cloud, as high as samples look for neighbours, with a small tree in each cell: what a sweep
// over a cloud keeps of it. Nearly all samples are put in order by their cells, which is cheap; the trees are a few
// levels deep where samples are as dense as is usual, and deeper where they are denser.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "samples/median_split.h"
#include "samples/nearest_few.h"

namespace lamina {

/// A sample on its way to its place, and where it is in the store.
struct StoredSample {
  std::array<std::int32_t, 3> at;
  std::array<float, 3> normal;
  std::uint32_t bucket, number;
};

/// Samples by place.
struct Placed {
  std::vector<std::int32_t> x, y, z;
  std::vector<float> nx, ny, nz;
  std::vector<std::uint32_t> bucket, number;  ///< where in the store they are
  [[nodiscard]] std::size_t size() const { return x.size(); }
  void resize(std::size_t n);
  /// Forgets the first ones; the others move up.
  void drop_front(std::size_t n);
  [[nodiscard]] PlacedAxes axes() const { return {x.data(), y.data(), z.data()}; }
};

/// Samples close together: places [begin, end).
struct SampleLeaf {
  std::size_t begin = 0, end = 0;
  [[nodiscard]] std::size_t size() const { return end - begin; }
};

/// Leaves are numbered, and samples placed, in the order of their cells; none is empty. The order inside a cell depends
/// on the samples' positions and the order in which they came.
class CellLayer {
 public:
  static constexpr std::size_t kMostInLeaf = 26;

  /// Memory of build(), kept from layer to layer.
  struct Scratch {
    struct Keyed {
      std::uint64_t key;
      std::uint32_t sample;
    };
    std::vector<Keyed> keyed, other;
    std::vector<TreeItem> items;
  };

  /// Gives the samples, all of one layer, the places from `first` on. `side` of a cell, steps.
  void build(std::span<const StoredSample> samples, std::int32_t side, std::size_t first, Scratch& scratch,
             Placed& out);
  /// All places are so many less.
  void move_up(std::size_t by);

  [[nodiscard]] const std::vector<SampleLeaf>& leaves() const { return leaves_; }

  /// Samples close together, each with the nearest found so far, and the box around them.
  struct Query {
    std::array<NearestFew, kMostInLeaf> own;
    std::size_t count = 0;
    ItemBox box;
    float bound = 0;  ///< the largest of their own
  };
  /// Adds to a query those of the cells (x - 1 .. x + 1, y).
  void search(Query& query, std::int32_t x, std::int32_t y, const PlacedAxes& at) const;
  /// How many samples of the cells (x - by .. x + by, y) lie within a squared distance of a position.
  [[nodiscard]] std::size_t count_within(const std::array<std::int32_t, 3>& from, float squared, std::int32_t x,
                                         std::int32_t y, std::int32_t by, const PlacedAxes& at) const;

 private:
  /// A cell with samples: places [begin, end), halved again and again until few are left; its tree is a heap of nodes.
  struct Cell {
    std::int32_t x, y;
    std::uint32_t depth;
    std::size_t begin, end;
    std::size_t first_node;
  };
  struct Subtree {
    std::size_t node, begin, end;
    std::uint32_t depth;  ///< levels below it
  };
  [[nodiscard]] std::size_t first_cell(std::int32_t x, std::int32_t y) const;
  void split(std::span<TreeItem> items, std::size_t first, const Subtree& tree, std::size_t first_node);
  void search(Query& query, const Cell& cell, const Subtree& tree, const PlacedAxes& at) const;

  std::vector<Cell> cells_;     ///< by y, then x
  std::vector<ItemBox> nodes_;  ///< the children of node i of a cell are 2 i + 1 and 2 i + 2
  std::vector<SampleLeaf> leaves_;
};

}  // namespace lamina

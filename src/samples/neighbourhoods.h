// Samples with what lies around them, slab by slab of the store: for tests of every sample against its neighbours.
// A sweep over a cloud keeps layers of cells, as high as samples look for neighbours, with a small tree in each cell.
// Nearly all samples are put in order by their cells, which is cheap; the trees are a few levels deep where samples are
// as dense as is usual, and deeper where they are denser.
#pragma once
#include <tbb/enumerable_thread_specific.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "lattice/lattice.h"
#include "samples/cleaning.h"
#include "samples/median_split.h"
#include "samples/nearest.h"
#include "store/slab_store.h"

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

/// The samples of a slab that are not masked, and of what lies around them. A slab is a few layers of cells as large as
/// neighbours are looked for; a layer is put in order once and kept while it is wanted, in memory that is used again.
class Neighbourhoods {
 public:
  static constexpr std::size_t kMostInLeaf = CellLayer::kMostInLeaf;
  /// Told of every leaf once which of its samples are worth a second look: writes 1 for them, else 0.
  using LeafTest = void (*)(const Placed& samples, const SampleLeaf& leaf, std::uint8_t* doubtful);

  /// Neighbours are looked for as far as `reach` (steps, at least 1); what lies three times as far above and below a
  /// slab comes with it.
  Neighbourhoods(const SlabStore& store, const KeepMasks& masks, float reach, LeafTest test);

  /// Goes on to the next slab; false behind the last one.
  bool advance();

  [[nodiscard]] const Placed& samples() const { return samples_; }
  [[nodiscard]] const std::vector<SampleLeaf>& leaves() const { return leaves_; }
  [[nodiscard]] bool is_doubtful(std::size_t place) const { return doubtful_[place] != 0; }
  /// Of the slab itself and not of its surroundings.
  [[nodiscard]] bool is_own(std::size_t place) const { return place >= own_.begin && place < own_.end; }
  /// Within `margin` of the slab along z.
  [[nodiscard]] bool is_near(std::size_t place, float margin) const {
    const auto by = static_cast<std::int64_t>(margin);
    return samples_.z[place] >= first_ * side_ - by && samples_.z[place] < end_ * side_ + by;
  }
  /// For places of one leaf the nearest others within reach, kNeighbours at most, nearest first, equally near ones by
  /// place. Of the first and the last layers not all are there.
  static constexpr std::size_t kNeighbours = NearestFew::kFew;
  struct Nearest {
    std::array<std::uint32_t, kNeighbours> places;
    std::size_t count = 0;
  };
  void find_nearest(std::span<const std::uint32_t> places, Nearest* found) const;
  /// How many others lie within twice the reach.
  [[nodiscard]] std::size_t count_within_twice(std::size_t place) const;

 private:
  struct Layer {
    std::vector<StoredSample> waiting;  ///< until it is put in order
    CellLayer cells;
    SampleLeaf places;  ///< all of its samples
    [[nodiscard]] std::size_t size() const { return waiting.empty() ? places.size() : waiting.size(); }
  };
  using Layers = std::map<std::int64_t, Layer>;

  /// Where a bucket's samples of a layer go: places in the layer's `waiting`.
  struct Places {
    Layer* layer = nullptr;
    std::size_t count = 0, next = 0;
  };
  /// A bucket on its way from the store to the layers.
  struct Arriving {
    std::size_t bucket = 0;
    LocalSamples samples;
    std::map<std::int64_t, Places> by_layer;
  };
  static constexpr std::size_t kReadAtOnce = 16;  ///< buckets

  void read_least();
  void read_below(std::int64_t z);
  void take_in(std::span<Arriving> buckets);
  Layer& layer_at(std::int64_t z);
  [[nodiscard]] std::size_t next_filled() const;
  std::optional<std::int64_t> complete_layer_from(std::int64_t layer);
  void forget_below(std::int64_t layer);
  void put_in_order();
  [[nodiscard]] const CellLayer* cells_of(std::int64_t layer) const;

  const SlabStore& store_;
  const KeepMasks& masks_;
  std::int32_t side_;  ///< of a cell, steps
  float reach_;
  LeafTest test_;
  FloorDivider cell_of_;
  std::size_t next_ = 0;              ///< bucket to be read
  std::int64_t first_ = 0, end_ = 0;  ///< layers of the slab
  Layers layers_;                     ///< read, while they are wanted; none is empty
  std::vector<Layers::node_type> spare_;
  std::vector<Arriving> arriving_ = std::vector<Arriving>(kReadAtOnce);
  tbb::enumerable_thread_specific<CellLayer::Scratch> scratch_;
  Placed samples_;
  std::vector<std::uint8_t> doubtful_;  ///< by place
  std::vector<SampleLeaf> leaves_;
  SampleLeaf own_;
};

}  // namespace lamina

// Samples with what lies around them, slab by slab of the store: for tests of every sample against its neighbours.
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
#include "samples/cell_layer.h"
#include "samples/outliers.h"
#include "store/slab_store.h"

namespace lamina {

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

  void read_next();
  void read_below(std::int64_t z);
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
  LocalSamples local_;
  tbb::enumerable_thread_specific<CellLayer::Scratch> scratch_;
  Placed samples_;
  std::vector<std::uint8_t> doubtful_;  ///< by place
  std::vector<SampleLeaf> leaves_;
  SampleLeaf own_;
};

}  // namespace lamina

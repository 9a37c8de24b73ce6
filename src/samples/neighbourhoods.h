// Samples with what lies around them, slab by slab of the store: for tests of every sample against its neighbours.
#pragma once
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "samples/outliers.h"
#include "samples/sample_tree.h"
#include "store/slab_store.h"

namespace lamina {

/// Samples by place of their tree.
struct Placed {
  std::span<const std::int32_t> x, y, z;
  std::vector<float> nx, ny, nz;
  std::vector<std::uint32_t> bucket, number;  ///< where in the store they are
  [[nodiscard]] std::size_t size() const { return x.size(); }
};

/// The samples of a slab of buckets that are not masked, and of what lies around them, in a tree. Memory is used again
/// from slab to slab.
class Neighbourhoods {
 public:
  /// Slabs are twice as high as `halo` (steps) at least: what lies so far above and below a slab comes with it.
  Neighbourhoods(const SlabStore& store, const KeepMasks& masks, std::int64_t halo)
      : store_(store), masks_(masks), halo_(halo) {}

  /// Goes on to the next slab; false behind the last one.
  bool advance();

  [[nodiscard]] const SampleTree& tree() const { return tree_; }
  [[nodiscard]] const Placed& samples() const { return samples_; }
  /// Of the slab itself and not of its surroundings.
  [[nodiscard]] bool is_own(std::size_t place) const {
    return samples_.bucket[place] >= first_ && samples_.bucket[place] < end_;
  }
  /// Within `margin` of the slab's samples along z.
  [[nodiscard]] bool is_near(std::size_t place, float margin) const {
    const auto by = static_cast<std::int64_t>(margin);
    return samples_.z[place] >= low_ - by && samples_.z[place] <= high_ + by;
  }

 private:
  /// A bucket's samples.
  struct Oriented {
    std::vector<std::int32_t> x, y, z;
    std::vector<float> nx, ny, nz;
  };
  struct InStore {
    std::uint32_t bucket, number;
  };
  using Held = std::map<std::size_t, Oriented>;

  void gather();
  void put_in_order(const std::vector<const Oriented*>& buckets, std::size_t from);
  const Oriented& read(std::size_t b);

  const SlabStore& store_;
  const KeepMasks& masks_;
  std::int64_t halo_;
  std::size_t first_ = 0, end_ = 0;  ///< buckets of the slab
  std::int64_t low_ = 0, high_ = 0;  ///< z of its samples
  Held held_;                        ///< buckets read, while they are wanted
  std::vector<Held::node_type> spare_;
  LocalSamples local_;
  std::vector<std::int32_t> x_, y_, z_;
  std::vector<InStore> all_;
  SampleTree tree_;
  Placed samples_;
};

}  // namespace lamina

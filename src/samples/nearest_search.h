// The nearest samples around many samples, one after another: for those of one block of the tree, the blocks around
// it are gathered once, and each of them looks through these instead of going down the tree again.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "samples/nearest.h"
#include "samples/sample_tree.h"

namespace lamina {

/// Of one thread. Finds what SampleTree::nearest() finds, several times as fast for places asked for in ascending
/// order.
class NearestSearch {
 public:
  explicit NearestSearch(const SampleTree& tree) : tree_(tree) {}

  /// As SampleTree::nearest().
  std::size_t nearest(std::uint32_t place, std::size_t k, float bound, Neighbour* found);

 private:
  void gather(std::uint32_t place);
  void list_blocks();

  const SampleTree& tree_;
  const SampleTree::Block* block_ = nullptr;
  std::size_t k_ = 0;
  float bound_ = 0;
  float reach_ = 0;     ///< all within this distance of the block lie in the blocks gathered, steps
  float farthest_ = 0;  ///< distance of the k-th neighbour of the sample before, steps
  std::vector<const SampleTree::Block*> around_;  ///< empty where they are too many
};

}  // namespace lamina

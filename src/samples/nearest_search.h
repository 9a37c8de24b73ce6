// The nearest samples around many samples, one after another: for those of one block of the tree, the blocks around
// it are gathered once, for those of one of its leaves the samples of these blocks, and each of them looks through
// these instead of going down the tree again.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "samples/near_kernel.h"
#include "samples/nearest.h"
#include "samples/sample_tree.h"

namespace lamina {

/// Of one thread. Finds what SampleTree::nearest() finds, several times as fast for places asked for in ascending
/// order.
class NearestSearch {
 public:
  explicit NearestSearch(const SampleTree& tree, const NearKernel& kernel = near_kernel())
      : tree_(tree), kernel_(kernel) {}

  static constexpr std::size_t kAtOnce = 4;
  /// Begins the search around some samples, kAtOnce at most, for what SampleTree::nearest() finds.
  void start(std::span<const std::uint32_t> places, std::size_t k, float bound);
  /// Finds those around the i-th of them. As SampleTree::nearest(), but wants room for SampleTree::kMostNeighbours.
  std::size_t finish(std::size_t i, Neighbour* found);

 private:
  /// The search around one sample. What has been found is put in order once the others' has been found, too: the
  /// processor would have to wait for it to reach memory.
  struct Started {
    std::uint32_t place = 0;
    bool found = false;
    NearSamples near;
  };
  bool look(std::uint32_t place, float reach, NearSamples& near);
  std::size_t nearest_in_tree(std::uint32_t place, Neighbour* found);
  void gather(std::uint32_t place);
  void list_blocks();
  bool gather_near_leaf(std::uint32_t place, float reach);
  void sort(NearSamples& near, Neighbour* found) const;

  const SampleTree& tree_;
  const NearKernel& kernel_;
  const SampleTree::Block* block_ = nullptr;
  std::size_t k_ = 0;
  float bound_ = 0;
  float reach_ = 0;     ///< all within this distance of the block lie in the blocks gathered, steps
  float farthest_ = 0;  ///< distance of the k-th neighbour of the last sample finished, steps
  std::vector<const SampleTree::Block*> around_;  ///< empty where they are too many
  std::uint32_t leaf_begin_ = 0, leaf_end_ = 0;   ///< of the block: places that near_leaf_ was gathered for
  float leaf_reach_ = -1;                         ///< likewise: within which distance, steps; below 0: not gathered
  float leaf_limit_ = 0;                          ///< likewise: within which distance they are too many, steps
  SamplesNearLeaf near_leaf_;
  std::array<Started, kAtOnce> started_;
};

}  // namespace lamina

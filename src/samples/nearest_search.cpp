#include "samples/nearest_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace lamina {
namespace {

constexpr std::size_t kMostWanted = 16;  ///< more of them are left to the tree, with all that the guess lets in
constexpr std::size_t kMostBlocks = 24;  ///< from more of them on the tree is faster
constexpr float kGuessedReach = 1.2F;    ///< of the distance to the k-th neighbour of the sample before
constexpr float kGatheredReach = 1.6F;   ///< likewise: farther ones are left to the tree
constexpr float kLeafReach = 1.5F;       ///< likewise, of what is gathered for a leaf
constexpr float kRounding = 1 + 1e-4F;   ///< of distances: nothing must be lost to it

}  // namespace

void NearestSearch::start(std::span<const std::uint32_t> places, std::size_t k, float bound) {
  if (k != k_ || bound != bound_) {
    k_ = k;
    bound_ = bound;
    block_ = nullptr;
    farthest_ = 0;
  }
  for (std::size_t i = 0; i < places.size(); ++i) {
    Started& one = started_[i];
    one.place = places[i];
    if (block_ == nullptr || !block_->holds(one.place)) gather(one.place);
    // Mostly its neighbours lie about as far as those of the samples before: enough within a guess are the nearest.
    one.found = look(one.place, kGuessedReach * farthest_, one.near);
  }
}

std::size_t NearestSearch::finish(std::size_t i, Neighbour* found) {
  Started& one = started_[i];
  if (!one.found && !(block_ != nullptr && block_->holds(one.place) && look(one.place, reach_, one.near)))
    return nearest_in_tree(one.place, found);
  sort(one.near, found);
  const std::size_t count = std::min(k_, one.near.count);
  if (count == k_) farthest_ = std::sqrt(found[count - 1].squared);
  return count;
}

/// Those within a distance of a place of the block. False where they are too many, or not sure to be enough.
bool NearestSearch::look(std::uint32_t place, float reach, NearSamples& near) {
  if (around_.empty() || reach > reach_ || !gather_near_leaf(place, reach)) return false;
  const float squared = std::min(bound_, reach * reach);
  kernel_.find(near_leaf_, tree_.position(place), static_cast<std::int32_t>(place), squared, near);
  return near.count <= NearSamples::kMost && (near.count >= k_ || reach * reach >= bound_);
}

std::size_t NearestSearch::nearest_in_tree(std::uint32_t place, Neighbour* found) {
  const std::size_t count = tree_.nearest(place, k_, bound_, found);
  if (count == k_ && !around_.empty()) {
    farthest_ = std::sqrt(found[count - 1].squared);
    // Samples may lie farther apart here than where the blocks were gathered for.
    if (kGuessedReach * farthest_ > reach_) block_ = nullptr;
  }
  return count;
}

/// Sees to it that all samples within `reach` of the leaf that has a place of the block are at hand. False where they
/// are too many.
bool NearestSearch::gather_near_leaf(std::uint32_t place, float reach) {
  const bool in_leaf = place >= leaf_begin_ && place < leaf_end_;
  if (in_leaf && reach <= leaf_reach_) return true;
  if (!in_leaf) leaf_limit_ = std::numeric_limits<float>::infinity();
  if (reach >= leaf_limit_) return false;
  std::size_t leaf = 0;
  while (place >= block_->begin[leaf + 1]) ++leaf;
  leaf_begin_ = block_->begin[leaf];
  leaf_end_ = block_->begin[leaf + 1];
  leaf_reach_ = std::max(reach, std::min(kLeafReach * farthest_, reach_));
  if (leaf_reach_ >= leaf_limit_) leaf_reach_ = reach;
  const ItemBox box = block_->box_of(leaf);
  const NearBox near{{box.low[0], box.low[1], box.low[2]},
                     {box.high[0], box.high[1], box.high[2]},
                     kRounding * leaf_reach_ * leaf_reach_};
  // First the leaves in reach are listed: which ones are is as good as random, and a branch for each could not be
  // guessed.
  std::array<PlaceRange, 4 * kMostBlocks + 1> leaves;
  std::size_t count = 0;
  for (const SampleTree::Block* const block : around_) {
    const unsigned in_reach = block->within(box, near.squared);
    for (std::size_t i = 0; i < 4; ++i) {
      leaves[count] = {block->begin[i], block->begin[i + 1]};
      count += in_reach >> i & 1;
    }
  }
  if (kernel_.gather(tree_.axes(), leaves.data(), count, near, near_leaf_)) return true;
  leaf_limit_ = leaf_reach_;
  leaf_reach_ = -1;
  return false;
}

/// Nearest first, equally near ones by place.
void NearestSearch::sort(NearSamples& near, Neighbour* found) const {
  static_assert(SampleTree::kSpare + 1 >= kNearLanes);
  static_assert(NearSamples::kMost + 2 * kNearLanes <= SampleTree::kMostNeighbours);
  if (kernel_.sort(near, found)) return;
  for (std::size_t i = 0; i < near.count; ++i) found[i] = {near.squared[i], static_cast<std::uint32_t>(near.places[i])};
  std::sort(found, found + near.count);
}

void NearestSearch::gather(std::uint32_t place) {
  block_ = &tree_.block_of(place);
  leaf_end_ = 0;
  around_.clear();
  std::array<Neighbour, kMostWanted> found;
  if (k_ == 0 || k_ > found.size()) return;
  // The block before lay beside this one, mostly.
  if (farthest_ > 0) list_blocks();
  if (!around_.empty()) return;
  const std::size_t count = tree_.nearest(place, k_, bound_, found.data());
  farthest_ = std::sqrt(count == k_ ? found[k_ - 1].squared : bound_);
  list_blocks();
}

void NearestSearch::list_blocks() {
  reach_ = std::min(kGatheredReach * farthest_, std::sqrt(bound_) * kRounding);
  const SampleTree::Around around{block_->box(), kRounding * reach_ * reach_};
  around_.clear();
  tree_.for_blocks(around, [&](const SampleTree::Block& block) {
    if (around_.size() <= kMostBlocks && block.within(around.box, around.squared) != 0) around_.push_back(&block);
  });
  if (around_.size() > kMostBlocks) around_.clear();
}

}  // namespace lamina

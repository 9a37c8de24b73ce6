#include "samples/nearest_search.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>

#include "base/four.h"

namespace lamina {
namespace {

constexpr std::size_t kMostWanted = 16;  ///< more of them are left to the tree, with all that the guess lets in
constexpr std::size_t kMostBlocks = 24;  ///< from more of them on the tree is faster
constexpr float kGuessedReach = 1.2F;    ///< of the distance to the k-th neighbour of the sample before
constexpr float kGatheredReach = 1.6F;   ///< likewise: farther ones are left to the tree
constexpr float kRounding = 1 + 1e-4F;   ///< of distances: nothing must be lost to it

/// By the bits of a mask: the bytes of those of four values that it has, one after another.
using BytesOfFour = std::array<std::array<std::uint8_t, 16>, 16>;
constexpr BytesOfFour bytes_by_mask() {
  BytesOfFour all{};
  for (std::size_t mask = 0; mask < 16; ++mask) {
    std::size_t at = 0;
    for (std::size_t lane = 0; lane < 4; ++lane) {
      if ((mask >> lane & 1) == 0) continue;
      for (std::size_t byte = 0; byte < 4; ++byte) all[mask][at++] = static_cast<std::uint8_t>(4 * lane + byte);
    }
  }
  return all;
}

/// Samples within a distance of one of them, itself left out, in the order in which they were found.
class Near {
 public:
  Near(const SampleTree& tree, std::uint32_t place, float bound)
      : tree_(&tree), place_(place), bound_(bound), at_(tree.position(place)) {}
  [[nodiscard]] bool is_full() const { return count_ > kMost; }
  [[nodiscard]] std::size_t count() const { return count_; }

  void take(const SampleTree::Block& block) {
    for (unsigned leaves = block.within(ItemBox::of(at_), bound_); leaves != 0; leaves &= leaves - 1) {
      const auto leaf = static_cast<std::size_t>(std::countr_zero(leaves));
      take_places(block.begin[leaf], block.begin[leaf + 1]);
    }
  }

  /// Writes the nearest ones in order and returns how many.
  std::size_t write(std::span<Neighbour> found) {
    const std::size_t n = std::min(found.size(), count_);
    if (rank()) {
      Neighbour none;
      for (std::size_t i = 0; i < count_; ++i) {
        const auto rank = static_cast<std::size_t>(ranks_[i]);
        (rank < n ? found[rank] : none) = neighbour(i);
      }
    } else {
      std::array<Neighbour, kMost> sorted;
      for (std::size_t i = 0; i < count_; ++i) sorted[i] = neighbour(i);
      std::sort(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(count_));
      std::copy_n(sorted.begin(), n, found.begin());
    }
    return n;
  }

 private:
  static constexpr std::size_t kMost = 64;
  static constexpr std::size_t kRankedAtOnce = 8;

  void take_places(std::uint32_t begin, std::uint32_t end) {
    static constexpr BytesOfFour kBytes = bytes_by_mask();
    tree_->fours_of(at_, begin, end, [&](const SampleTree::FourSamples& four) {
      if (is_full()) return;
      const FourInts wanted = (four.squared <= bound_) & (four.places != static_cast<std::int32_t>(place_));
      const unsigned mask = bits_of(wanted);
      __m128i bytes;
      std::memcpy(&bytes, kBytes[mask].data(), sizeof(bytes));
      const __m128i squared = _mm_shuffle_epi8(std::bit_cast<__m128i>(four.squared), bytes);
      const __m128i places = _mm_shuffle_epi8(std::bit_cast<__m128i>(four.places), bytes);
      std::memcpy(squared_.data() + count_, &squared, sizeof(squared));
      std::memcpy(places_.data() + count_, &places, sizeof(places));
      count_ += static_cast<std::size_t>(std::popcount(mask));
    });
  }

  [[nodiscard]] Neighbour neighbour(std::size_t i) const {
    return {squared_[i], static_cast<std::uint32_t>(places_[i])};
  }
  /// How many are nearer than each. False where some are as far as others.
  bool rank() {
    constexpr float kFar = std::numeric_limits<float>::infinity();
    std::fill_n(squared_.begin() + static_cast<std::ptrdiff_t>(count_), kRankedAtOnce, kFar);
    FourInts sum{};
    std::size_t ranked = 0;
    for (; ranked < count_; ranked += kRankedAtOnce) {
      FourFloats here;
      FourFloats next;
      std::memcpy(&here, squared_.data() + ranked, sizeof(here));
      std::memcpy(&next, squared_.data() + ranked + 4, sizeof(next));
      FourInts before_here{};
      FourInts before_next{};
      for (std::size_t j = 0; j < count_; ++j) {
        before_here -= squared_[j] < here;
        before_next -= squared_[j] < next;
      }
      std::memcpy(ranks_.data() + ranked, &before_here, sizeof(before_here));
      std::memcpy(ranks_.data() + ranked + 4, &before_next, sizeof(before_next));
      sum += before_here + before_next;
    }
    // Those behind the last one have all before them.
    const auto all = static_cast<std::size_t>(sum[0] + sum[1] + sum[2] + sum[3]) - (ranked - count_) * count_;
    return all == count_ * (count_ - 1) / 2;
  }

  const SampleTree* tree_;
  std::uint32_t place_;
  float bound_;  ///< squared
  std::array<std::int32_t, 3> at_;
  std::size_t count_ = 0;
  std::array<float, kMost + kRankedAtOnce> squared_;
  std::array<std::int32_t, kMost + kRankedAtOnce> places_, ranks_;
};

}  // namespace

std::size_t NearestSearch::nearest(std::uint32_t place, std::size_t k, float bound, Neighbour* found) {
  if (block_ == nullptr || !block_->holds(place) || k != k_ || bound != bound_) gather(place, k, bound);
  // Mostly its neighbours lie about as far as those of the sample before: enough within a guess are the nearest.
  for (const float guess : {kGuessedReach * farthest_, reach_}) {
    if (around_.empty() || guess > reach_) continue;
    Near near(tree_, place, std::min(bound, guess * guess));
    for (const SampleTree::Block* const block : around_) near.take(*block);
    if (near.is_full() || (near.count() < k && guess * guess < bound)) continue;
    const std::size_t count = near.write(std::span(found, k));
    if (count == k) farthest_ = std::sqrt(found[k - 1].squared);
    return count;
  }
  return tree_.nearest(place, k, bound, found);
}

void NearestSearch::gather(std::uint32_t place, std::size_t k, float bound) {
  block_ = &tree_.block_of(place);
  k_ = k;
  bound_ = bound;
  around_.clear();
  std::array<Neighbour, kMostWanted> found;
  if (k == 0 || k > found.size()) return;
  const std::size_t count = tree_.nearest(place, k, bound, found.data());
  farthest_ = std::sqrt(count == k ? found[k - 1].squared : bound);
  reach_ = std::min(kGatheredReach * farthest_, std::sqrt(bound) * kRounding);
  const SampleTree::Around around{block_->box(), kRounding * reach_ * reach_};
  tree_.for_blocks(around, [&](const SampleTree::Block& block) {
    if (around_.size() <= kMostBlocks && block.within(around.box, around.squared) != 0) around_.push_back(&block);
  });
  if (around_.size() > kMostBlocks) around_.clear();
}

}  // namespace lamina

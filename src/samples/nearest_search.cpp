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

/// Those of four values that a mask has, one after another.
class PackedFour {
 public:
  explicit PackedFour(unsigned mask) : mask_(mask) {
    static constexpr BytesOfFour kBytes = bytes_by_mask();
    std::memcpy(&bytes_, kBytes[mask].data(), sizeof(bytes_));
  }
  [[nodiscard]] std::size_t count() const { return static_cast<std::size_t>(std::popcount(mask_)); }
  /// From four values of four bytes to room for as many.
  void write(const void* from, void* to) const {
    __m128i four;
    std::memcpy(&four, from, sizeof(four));
    four = _mm_shuffle_epi8(four, bytes_);
    std::memcpy(to, &four, sizeof(four));
  }

 private:
  unsigned mask_;
  __m128i bytes_;
};

/// Samples within a distance of one of them, itself left out, in the order in which they were found.
class Near {
 public:
  Near(const SampleTree& tree, std::uint32_t place, float bound) : tree_(&tree), place_(place), bound_(bound) {}
  [[nodiscard]] bool is_full() const { return count_ > kMost; }
  [[nodiscard]] std::size_t count() const { return count_; }

  /// From at most kMostBlocks blocks. First the leaves in reach are listed: which ones are is as good as random, and
  /// a branch for each could not be guessed.
  void take(std::span<const SampleTree::Block* const> blocks) {
    const std::array<std::int32_t, 3> at = tree_->position(place_);
    const ItemBox box = ItemBox::of(at);
    std::array<std::int32_t, 4 * kMostBlocks + 4> begins;
    std::array<std::int32_t, 4 * kMostBlocks + 4> ends;
    std::size_t leaves = 0;
    for (const SampleTree::Block* const block : blocks) {
      const PackedFour in_reach(block->within(box, bound_));
      in_reach.write(block->begin.data(), begins.data() + leaves);
      in_reach.write(block->begin.data() + 1, ends.data() + leaves);
      leaves += in_reach.count();
    }
    for (std::size_t i = 0; i < leaves; ++i) take_places(at, begins[i], ends[i]);
  }

  /// Writes the nearest ones in order and returns how many.
  std::size_t write(std::span<Neighbour> found) {
    std::array<std::uint64_t, kMost> sorted;  // distance, then place: as bits that compare like neighbours
    const auto key = [&](std::size_t i) {
      return std::uint64_t{std::bit_cast<std::uint32_t>(squared_[i])} << 32 | static_cast<std::uint32_t>(places_[i]);
    };
    if (rank()) {
      // All of them: which ones are among the first is as good as random, a branch could not be guessed.
      for (std::size_t i = 0; i < count_; ++i) sorted[static_cast<std::size_t>(ranks_[i])] = key(i);
    } else {
      for (std::size_t i = 0; i < count_; ++i) sorted[i] = key(i);
      std::sort(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(count_));
    }
    const std::size_t n = std::min(found.size(), count_);
    for (std::size_t i = 0; i < n; ++i)
      found[i] = {std::bit_cast<float>(static_cast<std::uint32_t>(sorted[i] >> 32)),
                  static_cast<std::uint32_t>(sorted[i])};
    return n;
  }

 private:
  static constexpr std::size_t kMost = 64;
  static constexpr std::size_t kRankedAtOnce = 8;

  void take_places(const std::array<std::int32_t, 3>& at, std::int32_t begin, std::int32_t end) {
    // Copies that what is written to the lists cannot change.
    const float bound = bound_;
    const auto place = static_cast<std::int32_t>(place_);
    std::size_t count = count_;
    const auto places_end = static_cast<std::size_t>(end);
    tree_->fours_of(at, static_cast<std::size_t>(begin), places_end, [&](const SampleTree::FourSamples& four) {
      if (count > kMost) return;
      const PackedFour wanted(bits_of((four.squared <= bound) & (four.places != place)));
      wanted.write(&four.squared, squared_.data() + count);
      wanted.write(&four.places, places_.data() + count);
      count += wanted.count();
    });
    count_ = count;
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
  std::size_t count_ = 0;
  std::array<float, kMost + kRankedAtOnce> squared_;
  std::array<std::int32_t, kMost + kRankedAtOnce> places_, ranks_;
};

}  // namespace

std::size_t NearestSearch::nearest(std::uint32_t place, std::size_t k, float bound, Neighbour* found) {
  if (k != k_ || bound != bound_) {
    k_ = k;
    bound_ = bound;
    block_ = nullptr;
    farthest_ = 0;
  }
  if (block_ == nullptr || !block_->holds(place)) gather(place);
  // Mostly its neighbours lie about as far as those of the sample before: enough within a guess are the nearest.
  for (const float guess : {kGuessedReach * farthest_, reach_}) {
    if (around_.empty() || guess > reach_) continue;
    Near near(tree_, place, std::min(bound, guess * guess));
    near.take(around_);
    if (near.is_full() || (near.count() < k && guess * guess < bound)) continue;
    const std::size_t count = near.write(std::span(found, k));
    if (count == k) farthest_ = std::sqrt(found[k - 1].squared);
    return count;
  }
  const std::size_t count = tree_.nearest(place, k, bound, found);
  if (count == k && !around_.empty()) {
    farthest_ = std::sqrt(found[k - 1].squared);
    // Samples may lie farther apart here than where the blocks were gathered for.
    if (kGuessedReach * farthest_ > reach_) block_ = nullptr;
  }
  return count;
}

void NearestSearch::gather(std::uint32_t place) {
  block_ = &tree_.block_of(place);
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

#include "samples/stray_clutter.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "lamina/error.h"
#include "samples/neighbourhoods.h"
#include "samples/stray_passes.h"
#include "samples/stray_search.h"
#include "samples/stray_tests.h"

namespace lamina {
namespace {

/// Mean thickness (thickness_of()) from which on samples are clutter, averaged twice: of outliers all over a box it is
/// 0.3 within a few hundredths, of sparse surfaces under the noise of scans less than 0.2.
constexpr float kClutter = 0.24F;
/// Mean thickness, averaged once, from which on samples are clutter where half of their dozen are.
constexpr float kAmongClutter = 0.15F;
/// Clutter grows by a layer of samples each time.
constexpr int kMostRounds = 4;

/// The dozen nearest of each place of a slab and of what is around it.
class Dozens {
 public:
  /// Of the places within `margin` of the slab; the others have none.
  void find(const Neighbourhoods& around, float margin) {
    const std::size_t places = around.samples().size();
    nearest_.resize(places * kStrayNeighbours);
    count_.assign(places, 0);
    const std::vector<SampleLeaf>& leaves = around.leaves();
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, leaves.size(), 256), [&](const auto& range) {
      for (std::size_t leaf = range.begin(); leaf < range.end(); ++leaf) find_leaf(around, leaves[leaf], margin);
    });
  }

  [[nodiscard]] Company of(std::size_t place) const {
    Company out;
    out.count = count_[place];
    std::copy_n(&nearest_[place * kStrayNeighbours], out.count, out.places.begin());
    return out;
  }
  [[nodiscard]] bool is_whole(std::size_t place) const { return count_[place] == kStrayNeighbours; }

 private:
  void find_leaf(const Neighbourhoods& around, const SampleLeaf& leaf, float margin) {
    std::array<std::uint32_t, Neighbourhoods::kMostInLeaf> places;
    std::size_t n = 0;
    for (std::size_t p = leaf.begin; p < leaf.end; ++p) {
      if (around.is_near(p, margin)) places[n++] = static_cast<std::uint32_t>(p);
    }
    if (n == 0) return;
    std::array<Neighbourhoods::Nearest, Neighbourhoods::kMostInLeaf> found;
    around.find_nearest({places.data(), n}, found.data());
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t count = std::min(found[i].count, kStrayNeighbours);
      count_[places[i]] = static_cast<std::uint8_t>(count);
      std::copy_n(found[i].places.begin(), count, &nearest_[places[i] * kStrayNeighbours]);
    }
  }

  std::vector<std::uint32_t> nearest_;
  std::vector<std::uint8_t> count_;
};

/// A figure of each place, negative where it has none.
using Figures = std::vector<float>;

template <class Of>
Figures for_whole_dozens(const Dozens& dozens, std::size_t places, const Of& of) {
  Figures out(places, -1);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, places, 1024), [&](const auto& range) {
    for (std::size_t p = range.begin(); p < range.end(); ++p) {
      if (dozens.is_whole(p)) out[p] = of(p);
    }
  });
  return out;
}

Figures averaged(const Dozens& dozens, const Figures& figures) {
  return for_whole_dozens(dozens, figures.size(), [&](std::size_t p) {
    float sum = figures[p];
    float count = 1;
    const Company dozen = dozens.of(p);
    for (const std::uint32_t n : dozen.places) {
      if (figures[n] < 0) continue;
      sum += figures[n];
      ++count;
    }
    return sum / count;
  });
}

bool is_in(const KeepMasks& masks, const Placed& samples, std::size_t place) {
  const std::vector<bool>& bucket = masks[samples.bucket[place]];
  return !bucket.empty() && bucket[samples.number[place]];
}

/// One pass over the samples that `among` has, each compared with its dozen within reach.
class ClutterSweep {
 public:
  ClutterSweep(const SlabStore& store, const KeepMasks& among, double reach, const RunContext& run)
      : store_(store), among_(among), reach_(usable_reach(reach)), run_(run) {}

  struct Found {
    std::uint64_t clutter = 0;  ///< samples added
    KeepMasks alone;            ///< without a dozen within reach
    std::uint64_t alone_count = 0;
  };
  /// Adds what is clutter by itself.
  Found add(KeepMasks& clutter) const {
    Found found;
    found.alone.resize(among_.size());
    // The thickness of the dozens of those in the dozens of a slab's dozens.
    for_slabs(2, [&](const Neighbourhoods& around, const Dozens& dozens, const Figures& thickness) {
      const Placed& samples = around.samples();
      const Figures mean = averaged(dozens, averaged(dozens, thickness));
      for (std::size_t p = 0; p < samples.size(); ++p) {
        if (!around.is_own(p)) continue;
        if (mean[p] > kClutter && include(clutter, store_, samples.bucket[p], samples.number[p])) ++found.clutter;
        if (!dozens.is_whole(p) && include(found.alone, store_, samples.bucket[p], samples.number[p]))
          ++found.alone_count;
      }
    });
    return found;
  }

  /// Adds what lies among clutter: where the box of outliers ends their dozens are flatter. Returns how many it has
  /// added.
  std::uint64_t grow(KeepMasks& clutter) const {
    std::vector<std::pair<std::uint32_t, std::uint32_t>> more;
    for_slabs(1, [&](const Neighbourhoods& around, const Dozens& dozens, const Figures& thickness) {
      const Placed& samples = around.samples();
      const Figures mean = averaged(dozens, thickness);
      for (std::size_t p = 0; p < samples.size(); ++p) {
        if (!around.is_own(p) || mean[p] < kAmongClutter || is_in(clutter, samples, p)) continue;
        const Company dozen = dozens.of(p);
        const auto of_it = std::count_if(dozen.places.begin(), dozen.places.end(),
                                         [&](std::uint32_t n) { return is_in(clutter, samples, n); });
        if (2 * static_cast<std::size_t>(of_it) >= kStrayNeighbours)
          more.emplace_back(samples.bucket[p], samples.number[p]);
      }
    });
    for (const auto& [bucket, number] : more) include(clutter, store_, bucket, number);
    return more.size();
  }

 private:
  template <class Each>
  void for_slabs(float reaches, const Each& each) const {
    Neighbourhoods around(store_, among_, reach_, doubt_all);
    Dozens dozens;
    while (around.advance()) {
      if (run_.cancelled()) throw Error(ExitCode::internal, "cancelled");
      const Placed& samples = around.samples();
      dozens.find(around, reaches * reach_);
      each(around, dozens, for_whole_dozens(dozens, samples.size(), [&](std::size_t p) {
             return thickness_of(samples, p, dozens.of(p));
           }));
    }
  }

  const SlabStore& store_;
  const KeepMasks& among_;
  float reach_;
  const RunContext& run_;
};

}  // namespace

KeepMasks find_clutter(const SlabStore& store, const KeepMasks& far, double reach, const RunContext& run) {
  KeepMasks clutter(far.size());
  KeepMasks among = far;
  for (int pass = 0; pass < kMostReaches; ++pass, reach *= kNextReach) {
    const ClutterSweep sweep(store, among, reach, run);
    ClutterSweep::Found found = sweep.add(clutter);
    for (int round = 0; round < kMostRounds && found.clutter > 0; ++round) found.clutter = sweep.grow(clutter);
    if (!are_many(found.alone_count, store)) break;
    among = std::move(found.alone);
  }
  return clutter;
}

}  // namespace lamina

// Radii found in the background, ahead of the stages that want them.
#pragma once
#include <tbb/task_group.h>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <vector>

#include "lattice/lattice.h"
#include "samples/block_order.h"
#include "samples/radius_estimator.h"
#include "store/slab_store.h"

namespace lamina {

/// Reads where the samples of a store lie, bucket after bucket, and measures their radii. Where samples lie is wanted
/// long before the rest of them, which is read later: neither is kept.
class RadiiAhead {
 public:
  /// The store must outlive it. Throws as RadiusEstimator does.
  RadiiAhead(const SlabStore& store, const Lattice& lattice, const RadiiSettings& settings);
  /// Waits for the background.
  ~RadiiAhead();
  RadiiAhead(const RadiiAhead&) = delete;
  RadiiAhead& operator=(const RadiiAhead&) = delete;

  struct Measured {
    std::vector<float> radii;  ///< steps, in the order of sort_by_block()
    BlockOrder order;          ///< that order
  };
  /// Begins with this bucket, not with the first. Called before anything else.
  void begin_at(std::size_t bucket);
  /// Begins to measure all buckets up to the last one with a sample below z, in the background. Waits for what was
  /// begun before, and throws what take() would.
  void measure_below(std::int64_t z);
  /// Those measured and not taken yet, in ascending order, empty ones too. Waits for the background. Throws as
  /// SlabStore::read() and RadiusEstimator::push() do.
  std::vector<Measured> take();

 private:
  /// Where a bucket's samples lie.
  struct Positions {
    LocalSamples samples;  ///< in their order
    BlockOrder order;
    std::exception_ptr error;  ///< of a bucket that may never be asked for
  };
  void measure_next();
  void read_next();
  void read(std::size_t bucket, Positions& out) const;

  const SlabStore& store_;
  Lattice lattice_;
  RadiusEstimator estimator_;
  std::size_t read_ = 0;           ///< buckets read
  std::size_t announced_ = 0;      ///< buckets the system knows are wanted
  std::size_t pushed_ = 0;         ///< buckets handed to the estimator
  std::size_t measured_ = 0;       ///< buckets with radii
  std::deque<Positions> waiting_;  ///< read and not pushed
  std::deque<BlockOrder> orders_;  ///< of those pushed and not measured
  std::vector<Measured> done_;     ///< measured and not taken
  tbb::task_group tasks_;
};

}  // namespace lamina

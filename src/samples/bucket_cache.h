// Buckets in memory: read in the background before they are needed, kept within a budget, their samples in order by
// blocks of cells.
#pragma once
#include <tbb/task_group.h>

#include <cstdint>
#include <exception>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "lattice/lattice.h"
#include "samples/block_order.h"
#include "store/slab_store.h"

namespace lamina {

/// A bucket's samples with what refinement and projection need of each.
struct ActiveBucket {
  LocalSamples samples;             ///< in the order of sort_by_block()
  std::vector<float> support;       ///< R_i = H r_i, steps; 0: the sample is left out
  std::vector<float> weight;        ///< q_i
  std::vector<float> residual;      ///< how far outside of the surface fitted around it, steps; empty: not known
  std::vector<float> band;          ///< how near it has to be for a corner to keep a value, steps
  std::vector<std::uint8_t> level;  ///< coarsest level whose cells are small enough for the sample
  float max_support = 0;            ///< largest R_i, steps
};

/// Buckets are used by a sweep in ascending order, again and again in a window that slides upward: where the budget is
/// too small for the window, its lowest buckets stay.
class BucketCache {
 public:
  BucketCache(const SlabStore& store, const Lattice& lattice, std::size_t budget_bytes);
  ~BucketCache();
  BucketCache(const BucketCache&) = delete;
  BucketCache& operator=(const BucketCache&) = delete;

  /// A bucket's samples, sorted; a bucket just read has nothing else. Waits for the background when it is on its way.
  /// Throws as SlabStore::read().
  std::shared_ptr<ActiveBucket> get(std::size_t bucket);
  /// Starts reading a bucket in the background unless it is here or on its way. It stays until get() or drop().
  void prefetch(std::size_t bucket);
  /// The order of sort_by_block() of a bucket that comes is known.
  void know_order(std::size_t bucket, BlockOrder order);
  /// Forgets a bucket.
  void drop(std::size_t bucket);
  [[nodiscard]] std::uint64_t reads() const { return reads_; }  ///< times a bucket was read

 private:
  struct Incoming {
    std::shared_ptr<ActiveBucket> loaded = std::make_shared<ActiveBucket>();
    std::optional<BlockOrder> order;  ///< of the samples, where it is known
    std::exception_ptr error;
  };
  void load(std::size_t bucket, Incoming& incoming) const;
  std::shared_ptr<ActiveBucket> take(std::size_t bucket);
  void keep_within_budget(std::size_t wanted);

  const SlabStore& store_;
  Lattice lattice_;
  std::size_t budget_;
  std::size_t bytes_ = 0;
  std::uint64_t reads_ = 0;
  std::map<std::size_t, std::shared_ptr<ActiveBucket>> here_;
  std::map<std::size_t, Incoming> incoming_;
  std::map<std::size_t, BlockOrder> orders_;  ///< of buckets that are neither here nor on their way
  tbb::task_group tasks_;
};

}  // namespace lamina

// Buckets in memory: read in the background before they are needed, kept within a budget; their samples in order by
// blocks of cells, so that neighbours in space are neighbours in memory.
#pragma once
#include <tbb/task_group.h>

#include <cstdint>
#include <exception>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "lattice/lattice.h"
#include "store/slab_store.h"

namespace lamina {

/// Memory of sort_by_block().
struct BlockOrderScratch {
  std::vector<std::uint64_t> order, other;
  std::vector<std::int32_t> integers;
  std::vector<float> floats;
};

/// Sorts the samples of a bucket by the block of 8^3 finest cells they lie in: blocks by z, then y, then x (fastest);
/// inside a block in the order they had. A bucket that spans more than 2^32 such blocks is sorted by larger ones (twice
/// the side, four times, ...). The result is a function of the samples and the lattice alone.
void sort_by_block(LocalSamples& samples, const Lattice& lattice, BlockOrderScratch& scratch);

/// Numbers of a bucket's samples before they were sorted, in the order they were put in; empty: they had it already.
using BlockOrder = std::vector<std::uint32_t>;

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
  // Where the samples of a bucket lie is wanted long before the rest. They are not kept so long, but read again; in
  // their order, which is kept, so that they are sorted once.
  /// Starts reading positions as prefetch() does; they stay until get_positions().
  void prefetch_positions(std::size_t bucket);
  /// The positions alone, sorted as all of the bucket will be. Nothing of them stays here.
  LocalSamples get_positions(std::size_t bucket);
  /// Forgets a bucket.
  void drop(std::size_t bucket);
  [[nodiscard]] std::uint64_t reads() const { return reads_; }  ///< times a bucket or its positions were read

 private:
  struct Incoming {
    std::shared_ptr<ActiveBucket> loaded = std::make_shared<ActiveBucket>();
    std::optional<BlockOrder> order;  ///< of the samples: known before, or found with the positions
    std::exception_ptr error;
  };
  using Arriving = std::map<std::size_t, Incoming>;
  void load(std::size_t bucket, Columns wanted, Incoming& incoming);
  void start(std::size_t bucket, Columns wanted, Arriving& among);
  Incoming take(Arriving& from, std::size_t bucket);
  void keep_within_budget(std::size_t wanted);

  const SlabStore& store_;
  Lattice lattice_;
  std::size_t budget_;
  std::size_t bytes_ = 0;
  std::uint64_t reads_ = 0;
  std::map<std::size_t, std::shared_ptr<ActiveBucket>> here_;
  Arriving incoming_, positions_;
  std::map<std::size_t, BlockOrder> orders_;  ///< of buckets whose positions have been asked for, and nothing else
  tbb::task_group tasks_;
};

}  // namespace lamina

// The order of a bucket's samples in memory: by blocks of cells, so that neighbours in space are neighbours in memory.
#pragma once
#include <cstdint>
#include <vector>

#include "lattice/lattice.h"
#include "store/slab_store.h"

namespace lamina {

/// Memory of sort_by_block(), kept from bucket to bucket.
struct BlockOrderScratch {
  std::vector<std::uint64_t> order, other;
  std::vector<std::int32_t> integers;
  std::vector<float> floats;
};

/// Sorts the samples of a bucket by the block of 8^3 finest cells they lie in: blocks by z, then y, then x (fastest);
/// inside a block in the order they had. A bucket that spans more than 2^32 such blocks is sorted by larger ones (twice
/// the side, four times, ...). The result is a function of the samples and the lattice alone.
void sort_by_block(LocalSamples& samples, const Lattice& lattice, BlockOrderScratch& scratch);

}  // namespace lamina

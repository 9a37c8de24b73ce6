// The order of a bucket's samples in memory: by blocks of cells, so that neighbours in space are neighbours there.
#pragma once
#include <cstdint>
#include <vector>

#include "lattice/lattice.h"
#include "store/slab_store.h"

namespace lamina {

/// Memory of what follows, kept from bucket to bucket.
struct BlockOrderScratch {
  std::vector<std::uint64_t> order, other;
  std::vector<std::int32_t> integers;
  std::vector<float> floats;
};

/// Numbers of a bucket's samples, in the order they are to be put in; empty: they have it already.
using BlockOrder = std::vector<std::uint32_t>;

/// The order of sort_by_block(); asks for positions only.
BlockOrder order_by_block(const LocalSamples& samples, const Lattice& lattice, BlockOrderScratch& scratch);

/// Puts all there is of the samples in that order.
void put_in_order(LocalSamples& samples, const BlockOrder& order, BlockOrderScratch& scratch);

/// Sorts the samples of a bucket by the block of 8^3 finest cells they lie in: blocks by z, then y, then x (fastest);
/// inside a block in the order they had. A bucket that spans more than 2^32 such blocks is sorted by larger ones (twice
/// the side, four times, ...). The result is a function of the samples and the lattice alone.
void sort_by_block(LocalSamples& samples, const Lattice& lattice, BlockOrderScratch& scratch);

}  // namespace lamina

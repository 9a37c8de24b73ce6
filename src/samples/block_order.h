// The order of a bucket's samples in memory: by blocks of cells, so that neighbours in space are neighbours in memory.
#pragma once
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "lattice/lattice.h"
#include "store/slab_store.h"

namespace lamina {

/// A stable sort by small integers: by key(item), at most `largest`, in one pass per eleven bits of it. `scratch` is
/// storage kept between calls.
template <class T, class Key>
void digit_sort(std::vector<T>& items, std::vector<T>& scratch, std::uint64_t largest, const Key& key) {
  constexpr int kBits = 11;
  constexpr std::size_t kDigits = std::size_t{1} << kBits;
  scratch.resize(items.size());
  for (int shift = 0; shift < 64 && (largest >> shift) != 0; shift += kBits) {
    const auto digit = [&](const T& item) { return static_cast<std::size_t>(key(item) >> shift) & (kDigits - 1); };
    std::array<std::uint32_t, kDigits> begin{};
    for (const T& item : items) ++begin[digit(item)];
    std::uint32_t sum = 0;
    for (std::uint32_t& b : begin) sum += std::exchange(b, sum);
    for (const T& item : items) scratch[begin[digit(item)]++] = item;
    items.swap(scratch);
  }
}

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

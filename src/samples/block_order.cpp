#include "samples/block_order.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <utility>

#include "base/vectors.h"

namespace lamina {
namespace {

constexpr int kBlockShift = 3;  ///< a block is eight cells wide

/// A block's place in the bucket's box and the sample's number, the place in the high half.
using BlockEntry = std::uint64_t;

struct Axis {
  std::int32_t low = 0;      ///< block of the lowest sample
  std::uint64_t blocks = 1;  ///< from there to the highest one
};

Axis axis_of(const std::vector<std::int32_t>& values, const FloorDivider& cell, int shift) {
  const auto [low, high] = least_and_greatest(values);
  Axis axis{cell(low) >> shift, 1};
  axis.blocks += static_cast<std::uint64_t>(std::int64_t{cell(high) >> shift} - axis.low);
  return axis;
}

/// The box of the blocks; `shift` is raised until each has a place below 2^32.
std::array<Axis, 3> box_of(const LocalSamples& s, const FloorDivider& cell, int& shift) {
  constexpr double kPlaces = 4294967296.0;
  for (;; ++shift) {
    const std::array<Axis, 3> box{axis_of(s.x, cell, shift), axis_of(s.y, cell, shift), axis_of(s.z, cell, shift)};
    const auto places =
        static_cast<double>(box[0].blocks) * static_cast<double>(box[1].blocks) * static_cast<double>(box[2].blocks);
    if (places <= kPlaces) return box;
  }
}

template <class T>
void permute(std::vector<T>& values, const BlockOrder& order, std::vector<T>& scratch) {
  if (values.empty()) return;
  resize_anew(scratch, values.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, order.size(), kSampleGrain), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) scratch[i] = values[order[i]];
  });
  values.swap(scratch);
}

}  // namespace

BlockOrder order_by_block(const LocalSamples& s, const Lattice& lattice, BlockOrderScratch& scratch) {
  if (s.size() < 2 || s.size() > std::numeric_limits<std::uint32_t>::max()) return {};
  const FloorDivider cell(lattice.cell);
  int shift = kBlockShift;
  const auto [x, y, z] = box_of(s, cell, shift);
  std::vector<BlockEntry>& order = scratch.order;
  resize_anew(order, s.size());
  bool sorted = true;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const auto place = [shift = shift](std::int32_t c, const Axis& axis) {
      return static_cast<std::uint64_t>(std::int64_t{c >> shift} - axis.low);
    };
    const std::uint64_t key =
        (place(cell(s.z[i]), z) * y.blocks + place(cell(s.y[i]), y)) * x.blocks + place(cell(s.x[i]), x);
    order[i] = key << 32 | i;
    sorted = sorted && (i == 0 || order[i - 1] <= order[i]);
  }
  if (sorted) return {};
  digit_sort(order, scratch.other, x.blocks * y.blocks * z.blocks - 1, [](BlockEntry e) { return e >> 32; });
  BlockOrder numbers(order.size());
  std::transform(order.begin(), order.end(), numbers.begin(),
                 [](BlockEntry e) { return static_cast<std::uint32_t>(e); });
  return numbers;
}

void put_in_order(LocalSamples& s, const BlockOrder& order, BlockOrderScratch& scratch) {
  if (order.empty()) return;
  for (auto* values : {&s.x, &s.y, &s.z}) permute(*values, order, scratch.integers);
  for (auto* values : {&s.nx, &s.ny, &s.nz, &s.radius, &s.quality}) permute(*values, order, scratch.floats);
  for (auto& values : s.attributes) permute(values, order, scratch.floats);
}

void sort_by_block(LocalSamples& s, const Lattice& lattice, BlockOrderScratch& scratch) {
  put_in_order(s, order_by_block(s, lattice, scratch), scratch);
}

}  // namespace lamina

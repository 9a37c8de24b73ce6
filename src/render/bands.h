// Sharing out primitives to horizontal bands of the canvas: bands run in parallel, and inside a band the primitives
// come in their own order, so that a picture does not depend on the number of threads.
#pragma once
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace lamina::render_detail {

/// Rows first to last, both included; none when last < first.
struct Rows {
  int first = 0, last = -1;
};

/// Calls draw(i, rows) for every primitive i < count and every band that meets rows_of(i), with the rows they share.
/// rows_of may reach beyond the canvas; both functions are called from several threads.
template <class RowsOf, class Draw>
void draw_in_bands(std::size_t count, int height, const RowsOf& rows_of, const Draw& draw) {
  constexpr int kBand = 32;                             // rows
  constexpr std::size_t kChunk = std::size_t{1} << 14;  // primitives sorted by one task
  constexpr std::size_t kBlock = kChunk * 64;           // primitives sorted before drawing: bounds the lists
  const auto bands = static_cast<std::size_t>((height + kBand - 1) / kBand);
  std::vector<std::vector<std::vector<std::uint32_t>>> lists(kBlock / kChunk);
  for (std::size_t block = 0; block < count; block += kBlock) {
    const std::size_t block_size = std::min(kBlock, count - block);
    const std::size_t chunks = (block_size + kChunk - 1) / kChunk;
    tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t chunk) {
      auto& of_band = lists[chunk];
      of_band.resize(bands);
      for (auto& list : of_band) list.clear();
      const std::size_t end = std::min(block_size, (chunk + 1) * kChunk);
      for (std::size_t i = chunk * kChunk; i < end; ++i) {
        Rows rows = rows_of(block + i);
        rows = {std::max(rows.first, 0), std::min(rows.last, height - 1)};
        if (rows.last < rows.first) continue;
        for (int b = rows.first / kBand; b <= rows.last / kBand; ++b) {
          of_band[static_cast<std::size_t>(b)].push_back(static_cast<std::uint32_t>(i));
        }
      }
    });
    tbb::parallel_for(std::size_t{0}, bands, [&](std::size_t band) {
      const int top = static_cast<int>(band) * kBand;
      const int bottom = std::min(top + kBand, height) - 1;
      for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
        for (const std::uint32_t i : lists[chunk][band]) {
          const Rows rows = rows_of(block + i);
          draw(block + i, Rows{std::max(rows.first, top), std::min(rows.last, bottom)});
        }
      }
    });
  }
}

}  // namespace lamina::render_detail

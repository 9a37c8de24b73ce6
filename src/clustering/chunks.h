// Splits index ranges over threads. What is computed per chunk is joined in chunk order, or does not depend on order.
#pragma once
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cstddef>

namespace lamina::clustering {

/// As many chunks as threads can use, each of at least `least` items.
inline std::size_t chunk_count(std::size_t items, std::size_t least) {
  const auto threads = static_cast<std::size_t>(std::max(1, tbb::this_task_arena::max_concurrency()));
  const std::size_t wanted = threads == 1 ? 1 : 4 * threads;
  return std::clamp<std::size_t>(items / least, 1, wanted);
}

/// Calls fn(chunk, begin, end) for each chunk of [0, items).
template <class Fn>
void for_chunks(std::size_t items, std::size_t chunks, const Fn& fn) {
  const auto begin_of = [&](std::size_t chunk) { return items * chunk / chunks; };
  if (chunks == 1) {
    fn(std::size_t{0}, std::size_t{0}, items);
    return;
  }
  tbb::parallel_for(std::size_t{0}, chunks,
                    [&](std::size_t chunk) { fn(chunk, begin_of(chunk), begin_of(chunk + 1)); });
}

}  // namespace lamina::clustering

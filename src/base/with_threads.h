// Runs work on as many threads as the run was told.
#pragma once
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <utility>

namespace lamina {

/// `threads` 0: as many as the machine has. More than it has are granted too: a test of identity wants them.
template <class Work>
void with_threads(int threads, Work&& work) {
  if (threads <= 0) {
    std::forward<Work>(work)();
    return;
  }
  const tbb::global_control allow(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  tbb::task_arena(threads).execute(std::forward<Work>(work));
}

}  // namespace lamina

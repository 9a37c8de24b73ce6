// What a run may use: memory and threads.
#pragma once
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <cstdint>
#include <string>
#include <utility>

#include "lamina/run.h"

namespace lamina {

/// Throws Error(budget), saying what would do, where `needed` bytes are more than run.max_memory. `what`: "sorting".
void require_memory(const RunContext& run, std::uint64_t needed, const std::string& name, const std::string& what);

/// Bytes of memory that the machine has; 0 when it does not say.
std::uint64_t machine_memory();

/// Runs work on as many threads as the run was told. `threads` 0: as many as the machine has. More than it has are
/// granted too: a test of identity wants them. Where so many are at work already, they do this, too.
template <class Work>
void with_threads(int threads, Work&& work) {
  if (threads <= 0 || threads == tbb::this_task_arena::max_concurrency()) {
    std::forward<Work>(work)();
    return;
  }
  const tbb::global_control allow(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  tbb::task_arena(threads).execute(std::forward<Work>(work));
}

}  // namespace lamina

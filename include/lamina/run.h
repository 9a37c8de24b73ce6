// What a job is told about the run it is part of: threads, memory, temporary files, cancelling, progress and messages;
// and the version of the library.
#pragma once
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

namespace lamina {

enum class LogLevel { info, warning };

/// How far a job is.
struct Progress {
  std::string_view stage;           ///< "read", "surface", ...
  std::uint64_t samples_done = 0;   ///< samples that have left the stage
  std::uint64_t samples_total = 0;  ///< 0 when unknown
  std::int64_t slabs_done = 0;
  std::int64_t slabs_total = 0;  ///< 0 when unknown
};

/// A default-constructed context is silent, cannot be cancelled and uses every core. Every result is the same for any
/// number of threads.
struct RunContext {
  int threads = 0;             ///< 0: as many as the machine has
  std::size_t max_memory = 0;  ///< bytes of the process; 0: no limit. A job that needs more throws Error(budget)
  std::string tmp_dir;         ///< folder for temporary files; empty: next to the output, or the system's
  std::function<void(const Progress&)> progress;
  std::function<void(LogLevel, std::string_view)> log;
  const std::atomic<bool>* cancel = nullptr;  ///< the caller sets it, from any thread or a signal handler; jobs then
                                              ///< throw Error(internal, "cancelled") and leave no files

  [[nodiscard]] bool cancelled() const { return cancel != nullptr && cancel->load(std::memory_order_relaxed); }
  void info(std::string_view m) const {
    if (log) log(LogLevel::info, m);
  }
  void warn(std::string_view m) const {
    if (log) log(LogLevel::warning, m);
  }
};

/// The version of the library, as written into the files it makes: "major.minor.patch", null-terminated.
std::string_view version();

}  // namespace lamina

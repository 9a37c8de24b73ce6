// What a job is told about the run it is part of: threads, memory, cancel, and where progress and messages go.
#pragma once
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

namespace lamina {

enum class LogLevel { info, warning };

struct Progress {
  std::string_view stage;           ///< "read", "surface", ...
  std::uint64_t samples_done = 0;   ///< samples that have left the stage
  std::uint64_t samples_total = 0;  ///< 0 when unknown
  std::int64_t slabs_done = 0;
  std::int64_t slabs_total = 0;  ///< 0 when unknown
};

/// Plain settings; a default-constructed context is silent, uncancellable and uses every core.
struct RunContext {
  int threads = 0;             ///< 0: as many as the machine has
  std::size_t max_memory = 0;  ///< bytes, 0: no limit
  std::string tmp_dir;         ///< empty: next to the output
  std::function<void(const Progress&)> progress;
  std::function<void(LogLevel, std::string_view)> log;
  const std::atomic<bool>* cancel = nullptr;  ///< set by the caller, e.g. from a signal handler

  [[nodiscard]] bool cancelled() const { return cancel != nullptr && cancel->load(std::memory_order_relaxed); }
  void info(std::string_view m) const {
    if (log) log(LogLevel::info, m);
  }
  void warn(std::string_view m) const {
    if (log) log(LogLevel::warning, m);
  }
};

/// "major.minor.patch"; the view ends with a null character.
std::string_view version();

}  // namespace lamina

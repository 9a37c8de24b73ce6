// How well a run uses its threads.
#pragma once
#include <tbb/task_arena.h>
#include <tbb/task_scheduler_observer.h>

#include <chrono>
#include <mutex>

namespace lamina {

/// Watches the threads of an arena come and go. A thread goes when it has found no work for a while (a tenth of a
/// millisecond or so): what is shorter goes unseen.
class ThreadWatch final : public tbb::task_scheduler_observer {
 public:
  ThreadWatch(tbb::task_arena& arena, int threads) : task_scheduler_observer(arena), threads_(threads) {
    observe(true);
  }
  ~ThreadWatch() override { observe(false); }
  ThreadWatch(const ThreadWatch&) = delete;
  ThreadWatch& operator=(const ThreadWatch&) = delete;

  /// Seconds so far in which fewer than all threads had work.
  [[nodiscard]] double partly_idle() const {
    const std::lock_guard lock(mutex_);
    return partly_idle_ + (inside_ < threads_ ? seconds_since_change() : 0);
  }

  void on_scheduler_entry(bool /*is_worker*/) override { change(1); }
  void on_scheduler_exit(bool /*is_worker*/) override { change(-1); }

 private:
  using Clock = std::chrono::steady_clock;

  [[nodiscard]] double seconds_since_change() const {
    return std::chrono::duration<double>(Clock::now() - changed_).count();
  }
  void change(int by) {
    const std::lock_guard lock(mutex_);
    if (inside_ < threads_) partly_idle_ += seconds_since_change();
    inside_ += by;
    changed_ = Clock::now();
  }

  mutable std::mutex mutex_;
  int threads_;
  int inside_ = 0;
  double partly_idle_ = 0;
  Clock::time_point changed_ = Clock::now();
};

}  // namespace lamina

// A job of the library on behalf of a Python call: it runs in a thread of its own without the interpreter's lock, while
// the calling thread looks out for signals, calls progress and passes messages on.
#pragma once
#include <pybind11/pybind11.h>

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "common/console.h"
#include "lamina/run.h"

namespace lamina::python {

namespace py = pybind11;

/// One run. All functions are called with the interpreter's lock.
class Job {
 public:
  using Work = std::function<void(const RunContext&)>;

  /// `progress`: None, or called as progress(stage, done, left); False from it cancels the run.
  Job(const tools::RunOptions& options, py::object progress, Work work);
  ~Job() { stop(); }
  Job(const Job&) = delete;
  Job& operator=(const Job&) = delete;

  /// Once.
  void start();
  /// Waits until the run is over or `ready` says so, which is asked under the run's mutex. False when it is over.
  /// Throws what the run threw, what progress threw, and KeyboardInterrupt, once the run has ended.
  bool wait(const std::function<bool()>& ready);
  /// Waits for the end. Throws likewise.
  void finish();
  void cancel();
  /// Cancels and waits; says nothing of how the run ended.
  void stop();

  /// For what the run and the caller share.
  [[nodiscard]] std::mutex& mutex() { return mutex_; }
  /// Wakes both; to be called when what they wait for may have changed.
  void notify() { changed_.notify_all(); }
  /// In the run: waits until `go` holds, which is asked under the mutex, or the run is cancelled.
  void pause(std::unique_lock<std::mutex>& lock, const std::function<bool()>& go);

 private:
  struct Stage {
    std::string name;
    double began = 0;  ///< seconds
    double done = 0;   ///< 0..1
  };
  void run();
  void note(const Progress& progress);
  /// What has been noted and said since, to Python. False when the run is to end.
  void pass_on();
  void end();

  py::object progress_;
  Work work_;
  RunContext context_;
  std::atomic<bool> cancelled_ = false;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool over_ = false;
  std::exception_ptr error_;                       ///< of the run
  std::optional<Stage> noted_;                     ///< not yet passed on
  Stage stage_;                                    ///< the latest
  std::deque<std::pair<bool, std::string>> said_;  ///< warnings, and other messages
  std::exception_ptr python_error_;                ///< of a signal or of progress
  std::thread thread_;
};

/// Runs it to its end.
void run_job(const tools::RunOptions& options, py::object progress, Job::Work work);

/// Makes lamina::Error and mistakes in options a lamina.Error.
void translate_errors();

}  // namespace lamina::python

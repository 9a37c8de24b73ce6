#include "run.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <string_view>

#include "lamina/error.h"

namespace lamina::python {
namespace {

/// How often the calling thread looks for signals, calls progress and passes messages on.
constexpr std::chrono::milliseconds kLook{50};

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double share_done(const Progress& p) {
  double share = 0;
  if (p.samples_total > 0) {
    share = static_cast<double>(p.samples_done) / static_cast<double>(p.samples_total);
  } else if (p.slabs_total > 0) {
    share = static_cast<double>(p.slabs_done) / static_cast<double>(p.slabs_total);
  }
  return std::clamp(share, 0.0, 1.0);
}

void raise_error(const std::string& message, ExitCode code) {
  const py::object type = py::module_::import("lamina").attr("Error");
  PyErr_SetObject(type.ptr(), type(message, static_cast<int>(code)).ptr());
}

}  // namespace

Job::Job(const tools::RunOptions& options, py::object progress, Work work)
    : progress_(std::move(progress)), work_(std::move(work)) {
  if (!progress_.is_none() && !PyCallable_Check(progress_.ptr()))
    throw py::type_error("progress must be callable as progress(stage, done, left)");
  context_.threads = options.threads;
  context_.max_memory = options.max_memory;
  context_.tmp_dir = options.tmp_dir;
  context_.cancel = &cancelled_;
  context_.progress = [this](const Progress& p) { note(p); };
  context_.log = [this](LogLevel level, std::string_view text) {
    {
      const std::lock_guard lock(mutex_);
      said_.emplace_back(level == LogLevel::warning, text);
    }
    changed_.notify_all();
  };
}

void Job::start() {
  thread_ = std::thread([this] { run(); });
}

void Job::stop() {
  cancel();
  if (!thread_.joinable()) return;
  const py::gil_scoped_release unlocked;
  thread_.join();
}

void Job::run() {
  std::exception_ptr error;
  try {
    work_(context_);
  } catch (...) {
    error = std::current_exception();
  }
  {
    const std::lock_guard lock(mutex_);
    error_ = error;
    over_ = true;
  }
  changed_.notify_all();
}

void Job::note(const Progress& p) {
  {
    const std::lock_guard lock(mutex_);
    if (stage_.name != p.stage) stage_ = {std::string(p.stage), now(), 0};
    stage_.done = share_done(p);
    noted_ = stage_;
  }
  changed_.notify_all();
}

void Job::cancel() {
  cancelled_.store(true, std::memory_order_relaxed);
  changed_.notify_all();
}

void Job::pause(std::unique_lock<std::mutex>& lock, const std::function<bool()>& go) {
  // A cancelled run is not notified under the mutex: it looks.
  while (!go() && !cancelled_.load(std::memory_order_relaxed)) changed_.wait_for(lock, kLook);
}

void Job::pass_on() {
  std::deque<std::pair<bool, std::string>> said;
  std::optional<Stage> noted;
  {
    const std::lock_guard lock(mutex_);
    said.swap(said_);
    noted.swap(noted_);
  }
  if (!said.empty()) {
    const py::object logger = py::module_::import("logging").attr("getLogger")("lamina");
    for (const auto& [warning, text] : said) logger.attr(warning ? "warning" : "info")(text);
  }
  if (!noted || progress_.is_none()) return;
  const double elapsed = now() - noted->began;
  py::object left = py::none();
  // Too early an estimate is noise.
  if (noted->done >= 0.01 && elapsed >= 0.5) left = py::float_(elapsed * (1 - noted->done) / noted->done);
  const py::object go_on = progress_(noted->name, noted->done, left);
  if (go_on.is(py::bool_(false))) cancel();
}

bool Job::wait(const std::function<bool()>& ready) {
  for (bool over = false; !over;) {
    bool is_ready = false;
    {
      const py::gil_scoped_release unlocked;
      std::unique_lock lock(mutex_);
      changed_.wait_for(lock, kLook, [&] {
        is_ready = ready && ready();
        return over_ || is_ready;
      });
      over = over_;
    }
    try {
      if (!python_error_) {
        if (PyErr_CheckSignals() != 0) throw py::error_already_set();
        pass_on();
      }
    } catch (py::error_already_set&) {
      python_error_ = std::current_exception();
      cancel();
    }
    if (is_ready && !python_error_) return true;
  }
  end();
  return false;
}

void Job::end() {
  if (python_error_) std::rethrow_exception(python_error_);
  if (error_) std::rethrow_exception(error_);
}

void Job::finish() {
  while (wait({})) {
  }
}

void run_job(const tools::RunOptions& options, py::object progress, Job::Work work) {
  Job job(options, std::move(progress), std::move(work));
  job.start();
  job.finish();
}

void translate_errors() {
  py::register_exception_translator([](std::exception_ptr error) {
    try {
      if (error) std::rethrow_exception(error);
    } catch (const Error& e) {
      raise_error(e.what(), e.code());
    } catch (const CLI::ParseError& e) {
      raise_error(e.what(), ExitCode::usage);
    }
  });
}

}  // namespace lamina::python

// The tools at the terminal: run options, progress, messages and cancelling.
#pragma once
#include <CLI/CLI.hpp>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <mutex>
#include <string>
#include <string_view>

#include "lamina/run.h"

namespace lamina::tools {

/// The options every working tool understands.
struct RunOptions {
  int threads = 0;             ///< 0: as many as the machine has
  bool quiet = false;          ///< warnings and errors only
  std::string tmp_dir;         ///< empty: next to the output
  std::size_t max_memory = 0;  ///< bytes, 0: no limit
};

/// Adds --threads, --quiet, --tmp-dir and --max-memory in the group "Run". `options` must outlive the parse.
void add_run_options(CLI::App& app, RunOptions& options);

/// The context of a run: messages and progress go to standard error, and SIGINT and SIGTERM cancel it.
RunContext make_context(const RunOptions& options);
/// The same, with temporary files beside the output unless told otherwise: where that fits, they do.
RunContext make_context(const RunOptions& options, const std::string& output);

/// Set by SIGINT and SIGTERM after cancel_on_signals(); a second signal ends the program at once.
const std::atomic<bool>& cancel_requested();
/// From here on signals ask the running job to stop, so that it unwinds and its temporary files vanish. Writing into a
/// closed pipe, or past the largest file the shell allows, becomes an error of the writer.
void cancel_on_signals();

/// Writes messages and progress to a stream. On a terminal progress is one line, rewritten at most ten times a second;
/// elsewhere it is a plain line per stage and then one when five seconds or, past the first half second, ten per cent
/// have gone by.
class Console {
 public:
  struct Settings {
    std::FILE* out = stderr;
    bool terminal = false;
    bool quiet = false;
    std::function<double()> now;  ///< seconds; empty: the steady clock
  };
  explicit Console(Settings settings);
  ~Console();  ///< ends an unfinished progress line
  Console(const Console&) = delete;
  Console& operator=(const Console&) = delete;

  void progress(const Progress& progress);
  void message(LogLevel level, std::string_view text);

 private:
  struct Stage {
    std::string name;
    double began = 0;           ///< seconds
    double shown = 0;           ///< when a line was last written
    double shown_fraction = 0;  ///< what it said
  };
  void end_line();

  Settings settings_;
  std::mutex mutex_;
  Stage stage_;
  std::size_t open_columns_ = 0;  ///< width of the unfinished terminal line, 0: none
};

}  // namespace lamina::tools

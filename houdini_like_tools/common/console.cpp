#include "common/console.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <memory>
#include <utility>

#include "common/text.h"
#include "lamina/error.h"

namespace lamina::tools {
namespace {

constexpr double kTerminalInterval = 0.1;  // seconds between rewrites of the line
constexpr double kPlainInterval = 5;       // seconds between plain lines
constexpr double kPlainPause = 0.5;        // seconds at least, however fast the job runs
constexpr double kPlainFraction = 0.1;     // of the work between plain lines

// A signal handler can reach nothing but an object of static storage.
std::atomic<bool> cancel_flag{false};
static_assert(std::atomic<bool>::is_always_lock_free);

extern "C" void request_cancel(int) {
  cancel_flag.store(true, std::memory_order_relaxed);
}

double fraction_done(const Progress& p) {
  double fraction = 0;
  if (p.samples_total > 0) {
    fraction = static_cast<double>(p.samples_done) / static_cast<double>(p.samples_total);
  } else if (p.slabs_total > 0) {
    fraction = static_cast<double>(p.slabs_done) / static_cast<double>(p.slabs_total);
  }
  return std::clamp(fraction, 0.0, 1.0);
}

/// What a stage goes through one by one.
std::string_view piece_of(std::string_view stage) {
  return stage == "tiles" ? "tile" : "slab";
}

std::string progress_text(const Progress& p, double fraction, double elapsed) {
  std::string text(p.stage);
  if (p.samples_total > 0) {
    text += fmt::format("  {} of {} samples", count_text(p.samples_done), count_text(p.samples_total));
  } else if (p.samples_done > 0) {
    text += fmt::format("  {} samples", count_text(p.samples_done));
  }
  if (p.slabs_total > 0) text += fmt::format("  {} {} of {}", piece_of(p.stage), p.slabs_done, p.slabs_total);
  if (p.samples_total > 0 || p.slabs_total > 0) {
    text += fmt::format("  {:.0f} %", 100 * fraction);
    // Too early an estimate is noise.
    if (fraction >= 1) {
      text += "  " + seconds_text(elapsed);
    } else if (fraction >= 0.01 && elapsed >= 1) {
      text += "  " + seconds_text(elapsed * (1 - fraction) / fraction) + " left";
    }
  }
  return text;
}

/// Where a large cloud's temporary files fit as well as the output does; the system's folder for pipes and devices.
std::string folder_beside(const std::string& output) {
  std::error_code ignored;
  const auto kind = std::filesystem::status(output, ignored).type();
  const bool file = kind == std::filesystem::file_type::regular || kind == std::filesystem::file_type::not_found;
  if (output.empty() || output == "-" || !file) return {};
  const std::string parent = std::filesystem::path(output).parent_path().string();
  return parent.empty() ? "." : parent;
}

}  // namespace

void add_run_options(CLI::App& app, RunOptions& options) {
  app.add_option("--threads", options.threads,
                 "Number of threads; 0 is every core. The result is the same bytes for any number [0]")
      ->check(CLI::Range(0, 4096))
      ->type_name("N")
      ->group("Run");
  app.add_flag("-q,--quiet", options.quiet, "No progress, only warnings and errors")->group("Run");
  app.add_option("--tmp-dir", options.tmp_dir, "Folder for temporary files [beside the output]")
      ->check(CLI::ExistingDirectory.description(""))
      ->type_name("DIR")
      ->group("Run");
  app.add_option_function<std::string>(
         "--max-memory",
         [&options](const std::string& text) {
           try {
             options.max_memory = parse_bytes(text);
           } catch (const Error& e) {
             throw CLI::ValidationError("--max-memory", e.what());
           }
         },
         "Refuse to start what would need more memory, such as 512M or 4G [no limit]")
      ->type_name("SIZE")
      ->group("Run");
}

RunContext make_context(const RunOptions& options) {
  const auto console =
      std::make_shared<Console>(Console::Settings{stderr, isatty(fileno(stderr)) != 0, options.quiet, {}});
  RunContext context;
  context.threads = options.threads;
  context.max_memory = options.max_memory;
  context.tmp_dir = options.tmp_dir;
  context.progress = [console](const Progress& p) { console->progress(p); };
  context.log = [console](LogLevel level, std::string_view text) { console->message(level, text); };
  context.cancel = &cancel_requested();
  return context;
}

RunContext make_context(const RunOptions& options, const std::string& output) {
  RunContext context = make_context(options);
  if (context.tmp_dir.empty()) context.tmp_dir = folder_beside(output);
  return context;
}

const std::atomic<bool>& cancel_requested() {
  return cancel_flag;
}

void cancel_on_signals() {
  struct sigaction action = {};
  action.sa_handler = request_cancel;
  sigemptyset(&action.sa_mask);
  action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_RESTART;  // a second signal takes its default way
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

Console::Console(Settings settings) : settings_(std::move(settings)) {
  if (!settings_.now) {
    settings_.now = [] {
      return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
    };
  }
}

Console::~Console() {
  end_line();
}

void Console::end_line() {
  if (open_columns_ == 0) return;
  std::fputc('\n', settings_.out);
  std::fflush(settings_.out);
  open_columns_ = 0;
}

void Console::progress(const Progress& p) {
  if (settings_.quiet) return;
  const std::lock_guard lock(mutex_);
  const double now = settings_.now();
  const bool first = stage_.name != p.stage;
  if (first) {
    end_line();
    stage_ = {std::string(p.stage), now, now, 0};
  }
  const double fraction = fraction_done(p);
  const bool finished = fraction >= 1 && stage_.shown_fraction < 1;
  const double since = now - stage_.shown;
  const bool due = settings_.terminal ? since >= kTerminalInterval
                                      : since >= kPlainInterval || (since >= kPlainPause &&
                                                                    fraction - stage_.shown_fraction >= kPlainFraction);
  if (!first && !finished && !due) return;
  if (stage_.shown_fraction >= 1) return;  // the stage's last line is out
  const std::string text = "lamina: " + progress_text(p, fraction, now - stage_.began);
  if (settings_.terminal) {
    fmt::print(settings_.out, "\r{:<{}}", text, open_columns_);
    open_columns_ = text.size();
    if (finished) end_line();
  } else {
    fmt::print(settings_.out, "{}\n", text);
  }
  std::fflush(settings_.out);
  stage_.shown = now;
  stage_.shown_fraction = fraction;
}

void Console::message(LogLevel level, std::string_view text) {
  if (settings_.quiet && level == LogLevel::info) return;
  const std::lock_guard lock(mutex_);
  end_line();
  fmt::print(settings_.out, "lamina: {}{}\n", level == LogLevel::warning ? "warning: " : "", text);
  std::fflush(settings_.out);
}

}  // namespace lamina::tools

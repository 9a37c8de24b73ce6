#include "common/command_line.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <new>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

#include "common/console.h"
#include "common/help.h"
#include "common/job.h"
#include "common/text.h"
#include "lamina/error.h"
#include "lamina/ranks.h"
#include "lamina/run.h"

namespace lamina::tools {
namespace {

int exit_code(ExitCode code) {
  return static_cast<int>(code);
}

const CLI::App& chosen_tool(const CLI::App& app) {
  const auto chosen = app.get_subcommands();
  return chosen.empty() ? app : *chosen.front();
}

std::vector<std::string> option_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

std::string suggestion(std::string_view word, const std::vector<std::string>& candidates) {
  const std::string near = nearest_word(word, candidates);
  return near.empty() ? "" : fmt::format("; did you mean '{}'?", near);
}

std::vector<std::string> tool_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* tool : shown_tools(app)) names.push_back(tool->get_name());
  return names;
}

// The first word that cannot be meant, whatever else CLI11 found wanting: an unknown tool or option explains the rest.
std::string unknown_word(const CLI::App& app, const CLI::App& tool) {
  for (const std::string& word : app.remaining(true)) {
    if (word.size() > 1 && word.front() == '-') {
      const std::string name = word.substr(0, word.find('='));
      const std::vector<std::string> known = option_names(tool);
      if (std::find(known.begin(), known.end(), name) != known.end())
        return fmt::format("option '{0}' comes behind the tool: lamina {1} {0} ...", name, tool.get_name());
      return fmt::format("unknown option '{}'{}", name, suggestion(name, known));
    }
    if (&tool == &app) {
      return fmt::format("unknown tool '{}'{}", word, suggestion(word, tool_names(app)));
    }
    return fmt::format("unexpected argument '{}'", word);
  }
  return {};
}

/// Ranks that mpirun started fail together, and rank 0 says why. The others leave after it: mpirun ends the job with
/// the first that goes.
template <class... Arguments>
void complain(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
  if (launch().rank > 0) {
    std::this_thread::sleep_for(std::chrono::seconds(1));
    return;
  }
  fmt::print(stderr, format, std::forward<Arguments>(arguments)...);
}

int answer_parse_error(const CLI::App& app, const CLI::ParseError& error) {
  if (error.get_exit_code() == 0) return app.exit(error);  // help and version
  const CLI::App& tool = chosen_tool(app);
  const std::string command = &tool == &app ? "lamina" : "lamina " + tool.get_name();
  std::string reason = unknown_word(app, tool);
  if (reason.empty()) {
    reason =
        &tool == &app ? fmt::format("no tool named; there are {}", fmt::join(tool_names(app), ", ")) : error.what();
  }
  complain("{}: {} (see '{} --help')\n", command, reason, command);
  return exit_code(ExitCode::usage);
}

/// Threads take memory, too: the standard library says so by a code, TBB by its words.
bool is_short_of_memory(const std::exception& e) {
  if (const auto* system = dynamic_cast<const std::system_error*>(&e); system != nullptr)
    return system->code() == std::errc::resource_unavailable_try_again ||
           system->code() == std::errc::not_enough_memory;
  return std::string_view(e.what()).starts_with("pthread_create");
}

}  // namespace

Failure failure_in_flight() {
  try {
    throw;
  } catch (const Error& e) {
    return {e.code(), e.what()};
  } catch (const CLI::ParseError& e) {
    return {ExitCode::usage, e.what()};
  } catch (const std::bad_alloc&) {
    return {ExitCode::budget, "out of memory; free some, or see --max-memory to plan the job"};
  } catch (const std::exception& e) {
    const bool short_of = is_short_of_memory(e);
    return {short_of ? ExitCode::budget : ExitCode::internal,
            fmt::format("{}: {}", short_of ? "out of memory for threads" : "internal error", e.what())};
  }
}

int run_program(int argc, const char* const* argv, const std::vector<AddTool>& tools) {
  CLI::App app{"Lamina: streaming surface reconstruction from oriented points", "lamina"};
  app.set_version_flag("--version", "lamina " + std::string(version()));
  app.require_subcommand(1);
  app.get_formatter()->column_width(34);
  app.get_formatter()->label("SUBCOMMAND", "TOOL");
  try {
    for (const AddTool add : tools) add(app);
    add_jobs(app, tools);
    for (CLI::App* tool : app.get_subcommands({}))
      if (!tool->get_group().empty()) tool->group("Tools");
    cancel_on_signals();
    app.parse(argc, argv);
    return exit_code(ExitCode::ok);
  } catch (const CLI::ParseError& e) {
    return answer_parse_error(app, e);
  } catch (...) {
    const Failure failure = failure_in_flight();
    complain("lamina: {}\n", failure.reason);
    return exit_code(failure.code);
  }
}

}  // namespace lamina::tools

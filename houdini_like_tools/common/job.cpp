#include "common/job.h"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <iterator>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "common/console.h"
#include "common/help.h"
#include "common/inputs.h"
#include "common/text.h"
#include "lamina/error.h"
#include "lamina/ranks.h"

namespace lamina::tools {
namespace {

constexpr const char* kVersionKey = "lamina_job";
constexpr int kVersion = 1;

struct JobStep {
  std::string tool;
  Json values;  ///< by the names of the options
};

struct Job {
  std::string file;  ///< as shown
  std::vector<JobStep> steps;

  /// "job.json: step 2 (normal)".
  [[nodiscard]] std::string place(std::size_t step) const {
    const std::string& tool = steps.at(step).tool;
    return fmt::format("{}: step {}{}", file, step + 1, tool.empty() ? "" : " (" + tool + ")");
  }
};

/// A step read but not to be run.
struct Understood {};

std::string meant(std::string_view word, const std::vector<std::string>& candidates) {
  const std::string near = nearest_word(word, candidates);
  return near.empty() ? "" : fmt::format("; did you mean '{}'?", near);
}

/// Text that begins as an object does: whoever names a cloud of gigabytes by mistake learns so at once.
std::string read_job_text(const std::string& path, const std::string& shown) {
  std::ifstream file;
  if (path != "-") {
    file.open(path, std::ios::binary);
    if (!file) throw Error(ExitCode::unreadable, fmt::format("{}: cannot be opened", shown));
  }
  std::istream& in = path == "-" ? std::cin : file;
  char first = 0;
  in >> first;
  if (first != '{')
    throw Error(ExitCode::unreadable, fmt::format("{}: is no job; a job is JSON and begins with {{", shown));
  return first + std::string(std::istreambuf_iterator<char>(in), {});
}

/// The parser keeps the last of equal keys without a word.
class KeysOnce {
 public:
  bool operator()(int depth, Json::parse_event_t event, const Json& parsed) {
    constexpr std::size_t kDepthOfSteps = 2;
    const auto level = static_cast<std::size_t>(depth);
    if (seen_.size() < level + 2) seen_.resize(level + 2);
    if (event == Json::parse_event_t::object_start) {
      seen_[level + 1].clear();
      if (level == kDepthOfSteps) ++step_;
    }
    if (event != Json::parse_event_t::key || !twice_.empty()) return true;
    if (const auto name = parsed.get<std::string>(); !seen_[level].insert(name).second)
      twice_ = (level == kDepthOfSteps + 1 ? fmt::format("step {}: ", step_) : "") + "key '" + name + "' stands twice";
    return true;
  }
  /// Empty where no key stands twice.
  [[nodiscard]] const std::string& complaint() const { return twice_; }

 private:
  std::vector<std::set<std::string>> seen_;  ///< by depth
  std::string twice_;
  int step_ = 0;
};

Json parse_job_text(const std::string& text, const std::string& shown) {
  KeysOnce keys;
  Json document;
  try {
    document = Json::parse(text, std::ref(keys));
  } catch (const Json::exception& e) {
    const std::string_view what = e.what();
    throw Error(ExitCode::unreadable, fmt::format("{}: is not JSON: {}", shown, what.substr(what.find("] ") + 2)));
  }
  if (!keys.complaint().empty()) throw Error(ExitCode::usage, fmt::format("{}: {}", shown, keys.complaint()));
  return document;
}

void require_version(const Json& document, const std::string& shown) {
  const auto version = document.find(kVersionKey);
  if (version == document.end())
    throw Error(ExitCode::usage, fmt::format("{}: key '{}' is missing; a job has \"{}\": {}", shown, kVersionKey,
                                             kVersionKey, kVersion));
  if (!version->is_number_integer() || *version != kVersion)
    throw Error(ExitCode::usage, fmt::format("{}: key '{}': this program knows version {}, not {}", shown, kVersionKey,
                                             kVersion, version->dump()));
  for (const auto& [name, value] : document.items()) {
    if (name != kVersionKey && name != "steps") {
      throw Error(ExitCode::usage,
                  fmt::format("{}: there is no key '{}'{}", shown, name, meant(name, {kVersionKey, "steps"})));
    }
  }
}

Job read_job(const std::string& path) {
  Job job;
  job.file = shown_name(path);
  const Json document = parse_job_text(read_job_text(path, job.file), job.file);
  require_version(document, job.file);
  const auto steps = document.find("steps");
  if (steps == document.end() || !steps->is_array() || steps->empty())
    throw Error(ExitCode::usage, fmt::format("{}: key 'steps' must be a list of at least one step", job.file));
  for (const Json& step : *steps) {
    job.steps.emplace_back();
    const std::string place = job.place(job.steps.size() - 1);
    if (!step.is_object()) throw Error(ExitCode::usage, fmt::format("{}: is not an object", place));
    const auto tool = step.find("tool");
    if (tool == step.end() || !tool->is_string())
      throw Error(ExitCode::usage, fmt::format("{}: key 'tool' must name one, as in \"tool\": \"surface\"", place));
    job.steps.back() = {tool->get<std::string>(), step};
    job.steps.back().values.erase("tool");
  }
  return job;
}

Json job_json(const std::vector<JobStep>& steps) {
  Json list = Json::array();
  for (const JobStep& step : steps) {
    Json entry{{"tool", step.tool}};
    entry.update(step.values);
    list.push_back(std::move(entry));
  }
  return {{kVersionKey, kVersion}, {"steps", std::move(list)}};
}

void print_job(const std::vector<JobStep>& steps) {
  try {
    fmt::print("{}\n", job_json(steps).dump(2));
  } catch (const Json::exception&) {
    throw Error(ExitCode::usage, "--print-job: a name that is not UTF-8 cannot stand in JSON; rename the file");
  }
}

void require_tool(const CLI::App& app, const std::string& name) {
  std::vector<std::string> names;
  for (const CLI::App* tool : shown_tools(app)) names.push_back(tool->get_name());
  if (std::find(names.begin(), names.end(), name) != names.end()) return;
  throw Error(ExitCode::usage, fmt::format("key 'tool': there is no tool '{}' for a job{}", name, meant(name, names)));
}

/// A fresh program does one step, as one command line: its options are set and checked, `before` is called, and unless
/// that throws, the tool works.
void do_step(const std::vector<AddTool>& tools, const JobStep& step,
             const std::function<void(CLI::App& tool)>& before) {
  CLI::App app;
  for (const AddTool add : tools) add(app);
  require_tool(app, step.tool);
  CLI::App* tool = app.get_subcommand(step.tool);
  tool->preparse_callback([&](std::size_t) { take_values(*tool, step.values); });
  app.parse_complete_callback([&] { before(*tool); });
  app.parse(std::vector<std::string>{step.tool});
}

/// Does something with a step; what goes wrong is told with its place.
template <class Act>
void at_step(const Job& job, std::size_t step, const Act& act) {
  try {
    act();
  } catch (const Understood&) {
    return;
  } catch (...) {
    const Failure failure = failure_in_flight();
    throw Error(failure.code, fmt::format("{}: {}", job.place(step), about_keys(failure.reason)));
  }
}

/// The part of an input's name that must exist: not that of a pattern, nor a pose behind it.
std::string file_part(const std::string& name) {
  if (name == "-" || pipe_name(name) == "-" || name.find_first_of("*?[") != std::string::npos) return {};
  std::error_code ignored;
  if (std::filesystem::exists(name, ignored)) return {};
  return name.substr(0, name.rfind('@'));
}

/// Files that no earlier step can have made must be there before the first one works.
void require_inputs(const std::vector<NamedFile>& files, const std::vector<NamedFile>& made) {
  for (const NamedFile& file : files) {
    const std::string part = file.argument ? file_part(file.name) : std::string();
    std::error_code ignored;
    if (part.empty() || std::filesystem::exists(part, ignored)) continue;
    const auto wanted = std::filesystem::path(part).lexically_normal();
    const bool comes = std::any_of(made.begin(), made.end(), [&](const NamedFile& other) {
      const auto path = std::filesystem::path(other.name).lexically_normal();
      return path == wanted || path.parent_path() == wanted;
    });
    if (!comes)
      throw Error(ExitCode::unreadable,
                  fmt::format("key '{}': {} is not there, and no step before writes it", file.key, file.name));
  }
}

/// Everything that can be known before the work begins. The steps come back as --print-job prints them.
std::vector<JobStep> check_job(const Job& job, const std::vector<AddTool>& tools) {
  std::vector<JobStep> steps;
  std::vector<NamedFile> made;
  for (std::size_t i = 0; i < job.steps.size(); ++i) {
    at_step(job, i, [&] {
      do_step(tools, job.steps[i], [&](CLI::App& tool) {
        steps.push_back({job.steps[i].tool, values_of(tool)});
        const std::vector<NamedFile> files = files_of(tool, steps.back().values);
        require_inputs(files, made);
        std::copy_if(files.begin(), files.end(), std::back_inserter(made),
                     [](const NamedFile& file) { return !file.argument; });
        throw Understood{};
      });
    });
  }
  return steps;
}

void run_job(const std::string& path, const std::vector<AddTool>& tools) {
  if (launch().size > 1)
    throw Error(ExitCode::usage, "run: a job is for one process; start its surface step by itself under mpirun");
  const Job job = read_job(path);
  check_job(job, tools);
  for (std::size_t i = 0; i < job.steps.size(); ++i) {
    at_step(job, i, [&] {
      if (cancel_requested()) throw Error(ExitCode::internal, "cancelled");
      do_step(tools, job.steps[i], [&](CLI::App& tool) {
        const CLI::Option* quiet = tool.get_option_no_throw("--quiet");
        if (job.steps.size() > 1 && (quiet == nullptr || quiet->count() == 0))
          fmt::print(stderr, "lamina: step {} of {}: {}\n", i + 1, job.steps.size(), job.steps[i].tool);
      });
    });
  }
}

}  // namespace

void add_jobs(CLI::App& app, const std::vector<AddTool>& tools) {
  auto* tool = app.add_subcommand("run", "Run the tools that a job file names, one after another");
  auto path = std::make_shared<std::string>();
  tool->add_option("JOB", *path, "Job file (JSON), as --print-job prints it; - for standard input")
      ->required()
      ->type_name("");
  add_notes(*tool,
            "Keys are the long names of options without their dashes; arguments stand under their names in small "
            "letters. The whole job is checked before its first step begins. A step that fails ends it with the step's "
            "exit code. Relative names are looked up from the working directory, wherever the job file lies.");
  add_examples(*tool,
               "  lamina run job.json\n"
               "  lamina run job.json --print-job");
  tool->callback([path, tools] { run_job(*path, tools); });
  for (const CLI::App* shown : shown_tools(app)) {
    app.get_subcommand(shown->get_name())
        ->add_flag("--print-job")
        ->description("Print what was typed as a job for lamina run, and do nothing else")
        ->group("Run");
  }
  // All is parsed and checked then, and nothing has begun.
  app.parse_complete_callback([&app, path, tools] {
    CLI::App* chosen = app.get_subcommands().front();
    if (chosen->get_option_no_throw("--print-job") == nullptr || chosen->count("--print-job") == 0) return;
    const bool of_file = chosen->get_name() == "run";
    print_job(of_file ? check_job(read_job(*path), tools)
                      : std::vector<JobStep>{{chosen->get_name(), values_of(*chosen)}});
    throw CLI::Success();
  });
}

}  // namespace lamina::tools

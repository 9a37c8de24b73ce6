#include "common/parts.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>
#include <vector>

#include "common/text.h"
#include "lamina/error.h"

namespace lamina::tools {
namespace {

using Words = std::vector<std::string>;

/// "3/7".
Chunk parse_chunk(const std::string& text) {
  Chunk chunk;
  const char* const end = text.data() + text.size();
  const auto [slash, bad] = std::from_chars(text.data(), end, chunk.number);
  if (bad == std::errc() && slash != end && *slash == '/') {
    const auto [rest, worse] = std::from_chars(slash + 1, end, chunk.count);
    if (worse == std::errc() && rest == end) return chunk;
  }
  throw Error(ExitCode::usage,
              fmt::format("--chunk {}: must be two whole numbers, as in 3/7: the third of seven", text));
}

/// A word as a shell takes it.
std::string shell_word(const std::string& word) {
  const bool plain = !word.empty() && std::all_of(word.begin(), word.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 || std::string_view("_-./,:=+@%").find(static_cast<char>(c)) != std::string_view::npos;
  });
  if (plain) return word;
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

std::string shell_line(const Words& words) {
  Words quoted;
  for (const std::string& word : words) quoted.push_back(shell_word(word));
  return fmt::format("{}", fmt::join(quoted, " "));
}

/// What the merge is told, and no chunk.
constexpr std::array kOfMerge{"error", "triangles", "ratio"};

bool is_one_of(std::span<const char* const> names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// The options given that pass.
template <class Passes>
Words options_given(const CLI::App& tool, const Passes& passes) {
  Words words;
  for (const CLI::Option* option : tool.get_options()) {
    if (option->count() == 0 || option->get_lnames().empty()) continue;
    const std::string& name = option->get_lnames().front();
    if (!passes(name)) continue;
    words.push_back("--" + name);
    if (option->get_expected_min() == 0) continue;  // a flag
    for (const std::string& value : option->results()) words.push_back(value);
  }
  return words;
}

/// Those that every chunk wants, too.
Words common_options(const CLI::App& tool) {
  static constexpr std::array kOwn{"output", "print-tasks", "json", "help", "stats", "preview"};
  return options_given(tool, [](const std::string& n) { return !is_one_of(kOwn, n) && !is_one_of(kOfMerge, n); });
}

struct Task {
  std::string name, output;
  Words command, after;
};

std::vector<Task> list_tasks(const CLI::App& tool, const std::string& input, const std::vector<std::string>& outputs,
                             int count) {
  const std::filesystem::path mesh(outputs.front());
  const std::string stem = (mesh.parent_path() / mesh.stem()).string();
  const Words options = common_options(tool);
  const std::size_t digits = std::to_string(count).size();
  std::vector<Task> tasks;
  Task merge{"merge", outputs.front(), {"lamina", "merge"}, {}};
  for (int number = 1; number <= count; ++number) {
    Task task;
    task.name = fmt::format("chunk {}/{}", number, count);
    task.output = fmt::format("{}.part_{:0{}}_of_{}.lmesh", stem, number, digits, count);
    task.command = {"lamina", "surface", input};
    task.command.insert(task.command.end(), options.begin(), options.end());
    for (const std::string& word :
         {std::string("--chunk"), fmt::format("{}/{}", number, count), std::string("-o"), task.output})
      task.command.push_back(word);
    merge.command.push_back(task.output);
    merge.after.push_back(task.name);
    tasks.push_back(std::move(task));
  }
  const Words of_merge = options_given(tool, [](const std::string& n) { return is_one_of(kOfMerge, n); });
  merge.command.insert(merge.command.end(), of_merge.begin(), of_merge.end());
  for (const std::string& output : outputs) merge.command.insert(merge.command.end(), {"-o", output});
  tasks.push_back(std::move(merge));
  return tasks;
}

}  // namespace

void add_parts_options(CLI::App& tool, PartsOptions& o) {
  const std::string group = "Parts";
  tool.add_option_function<std::string>(
          "--chunk",
          [&o](const std::string& text) {
            o.chunk = parse_chunk(text);
            o.chunked = true;
          },
          "Reconstruct only the I-th of N chunks of a store (lamina sort --store); the output is a part for lamina "
          "merge")
      ->type_name("I/N")
      ->group(group);
  auto* tasks =
      tool.add_option(
              "--print-tasks", o.tasks,
              "Print the command lines for a queue with the options given: N chunks, then the merge; run nothing")
          ->check(CLI::Range(1, 100000).description(""))
          ->type_name("N")
          ->group(group);
  tool.add_flag("--json", o.json, "Print the tasks as JSON: command, output, and what each comes after")
      ->needs(tasks)
      ->group(group);
  auto* checkpoint =
      tool.add_option("--checkpoint", o.checkpoint.directory,
                      "Keep what is done in this folder, so that a run that was killed can go on; removed at the end")
          ->type_name("DIR")
          ->group(group);
  tool.add_flag("--resume", o.checkpoint.resume, "Go on with what --checkpoint has; begin where it has nothing")
      ->needs(checkpoint)
      ->group(group);
}

PartsResult run_parts(const SurfaceSettings& settings, const PartsOptions& options, const RunContext& context) {
  const bool resumable = !options.checkpoint.directory.empty();
  if (options.chunked && resumable)
    throw Error(ExitCode::usage, "--chunk and --checkpoint contradict each other; a chunk is simply run again");
  if (resumable) return {reconstruct_resumable(settings, options.checkpoint, context), {}};
  if (!options.chunked) return {reconstruct_surface(settings, context), {}};
  const ChunkStats stats = reconstruct_chunk(settings, options.chunk, context);
  context.info(fmt::format("chunk {}/{}: slabs {} to {} of {} and {} beside them, about {} of {} samples",
                           options.chunk.number, options.chunk.count, stats.first_slab + 1,
                           stats.first_slab + stats.slabs, stats.all_slabs, stats.overlap_slabs,
                           count_text(stats.samples), count_text(stats.surface.plan.samples)));
  return {stats.surface, stats};
}

RanksStats run_ranks(const SurfaceSettings& settings, const PartsOptions& parts, const RunContext& context) {
  for (const auto& [given, option] :
       {std::pair{parts.chunked, "--chunk"}, std::pair{!parts.checkpoint.directory.empty(), "--checkpoint"}}) {
    if (given) {
      throw Error(ExitCode::usage,
                  fmt::format("{} and mpirun contradict each other: both share out the work; leave one away", option));
    }
  }
  return reconstruct_ranks(settings, context);
}

void report_ranks(const std::vector<RankStats>& ranks, const RunContext& context) {
  for (std::size_t r = 0; r < ranks.size(); ++r) {
    const RankStats& s = ranks[r];
    context.info(fmt::format(
        "rank {}: read {}, held {} samples; {} slabs and {} beside them; {:.1f} s ({:.1f} s sweeping, {:.1f} s "
        "waiting), {:.1f} s CPU, {:.0f} MB, {} sent",
        r, count_text(s.rows_read), count_text(s.samples_held), s.slabs, s.overlap_slabs, s.seconds, s.sweeping,
        s.waited, s.cpu, static_cast<double>(s.peak_memory) * 1e-6, bytes_text(s.sent)));
  }
}

void print_tasks(const CLI::App& tool, const std::string& input, const std::vector<std::string>& outputs,
                 const PartsOptions& options) {
  if (outputs.empty() || std::find(outputs.begin(), outputs.end(), "-") != outputs.end())
    throw Error(ExitCode::usage, "--print-tasks: give --output the name of the mesh; the parts will lie beside it");
  const std::vector<Task> tasks = list_tasks(tool, input, outputs, options.tasks);
  if (!options.json) {
    for (const Task& task : tasks) fmt::print("{}\n", shell_line(task.command));
    return;
  }
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Task& task : tasks) {
    list.push_back({{"name", task.name},
                    {"command", task.command},
                    {"shell", shell_line(task.command)},
                    {"output", task.output},
                    {"after", task.after}});
  }
  fmt::print("{}\n", nlohmann::ordered_json{{"tasks", list}}.dump(2));
}

}  // namespace lamina::tools

// docs/reference.md, printed from the tools' own options.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>

#include "common/help.h"

namespace lamina::tools {
namespace {

constexpr std::array kRunOptions{"--threads", "--quiet", "--tmp-dir", "--max-memory"};
constexpr std::string_view kEverywhere = "--print-job";

constexpr std::string_view kPreface = R"(# Reference

Every option of every tool. The program prints this page itself (`lamina man --reference`), and a test compares the two, so do
not edit it. `lamina TOOL --help` and `man lamina-TOOL` say the same.

## Conventions

- **Files.** The ending of an output's name chooses its format where there is a choice: [formats.md](formats.md). `-` is standard
  input or output, as PLY; `stdin.ply` and `stdout.ply` mean the same, so tools can stand in pipes. A PLY begins with the number
  of its points. A tool that does not know the number beforehand keeps what it writes to a pipe in an unnamed temporary file
  until it does, and input from a pipe is kept in one so that it can be read twice. Neither is held in memory.
- **Existing files** are replaced, and only by complete ones: output appears under its name when it is finished.
- **Coordinates** are computed in double, in the units of the input.
- **`LENGTH`** is a number in the input's units. Where the table says `LENGTH|Kr|KR` a length may also be a multiple of the sample
  radius r (`3r`) or of the influence radius R (`0.9R`); [method.md](method.md) explains the two.
- **`SIZE`** is a number of bytes, with `K`, `M`, `G` or `T` for powers of 1024: `512M`, `1.5G`.
- **`X,Y,Z`** and other lists are one word without blanks. A value that begins with a minus sign needs no quotes: `--rotate -90,0,0`.
- A vertical bar separates alternatives: `auto|yes|no` takes one of three words.
- JSON written by `--stats` and `--json` is described in [statistics.md](statistics.md).
)";

/// In a cell of a table even code needs its bars escaped.
std::string code(std::string_view text) {
  std::string escaped;
  for (const char c : text) escaped += c == '|' ? std::string("\\|") : std::string(1, c);
  return "`" + escaped + "`";
}

/// The length of what is code at the text's beginning: an option, or a command with its options.
std::size_t code_length(std::string_view text) {
  const auto word_end = [&](std::size_t at) {
    while (at < text.size() && (std::isalnum(static_cast<unsigned char>(text[at])) != 0 || text[at] == '-')) ++at;
    return at;
  };
  constexpr std::string_view kProgram = "lamina ";
  std::size_t end = 0;
  if (text.starts_with(kProgram)) end = word_end(kProgram.size());
  while (text.substr(end).starts_with(end > 0 ? " --" : "--")) {
    const std::size_t next = word_end(end + (end > 0 ? 3 : 2));
    if (next <= end + 3) break;
    end = next;
  }
  return end;
}

/// The text as Markdown shows it: options and commands in code type, longer commands where they stand in quotes, and
/// no accidental markup.
std::string markdown(std::string_view text) {
  std::string out;
  for (std::size_t at = 0; at < text.size();) {
    const bool word_start = at == 0 || text[at - 1] == ' ' || text[at - 1] == '(';
    const bool quoted = word_start && text[at] == '\'' && text.find('\'', at + 1) != std::string_view::npos;
    if (quoted) {
      const std::size_t end = text.find('\'', at + 1);
      out += code(text.substr(at + 1, end - at - 1));
      at = end + 1;
    } else if (const std::size_t length = word_start ? code_length(text.substr(at)) : 0; length > 0) {
      out += code(text.substr(at, length));
      at += length;
    } else {
      if (text[at] == '|' || text[at] == '*' || text[at] == '<' || text[at] == '_') out += '\\';
      out += text[at++];
    }
  }
  return out;
}

std::string sentence(std::string text) {
  const std::size_t end = text.find_first_of(" :,;");
  const bool to_type = end != std::string::npos && text[end] == ':';  // "pca: along ...": a word as it is typed
  if (!text.empty() && !to_type) text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
  return text;
}

std::string left_column(const OptionEntry& entry) {
  if (entry.positional) return code(entry.names.front() + (entry.repeatable ? "..." : ""));
  std::string column;
  for (std::size_t i = 0; i < entry.names.size(); ++i) {
    const bool last = i + 1 == entry.names.size();
    column += (i > 0 ? ", " : "") + code(entry.names[i] + (last && !entry.value.empty() ? " " + entry.value : ""));
  }
  return column;
}

std::string meaning(const OptionEntry& entry) {
  std::string text = markdown(sentence(entry.description));
  if (!entry.range.empty()) text += fmt::format(" ({})", entry.range);
  const auto list = [&](const char* word, const std::vector<std::string>& names) {
    if (!names.empty()) text += fmt::format(". {} `{}`", word, fmt::join(names, "`, `"));
  };
  list("Needs", entry.needs);
  list("Not with", entry.excludes);
  return text;
}

std::string row(const OptionEntry& entry) {
  const std::string usual = entry.required ? "required" : entry.fallback.empty() ? "" : markdown(entry.fallback);
  return fmt::format("| {} | {} | {} |\n", left_column(entry), usual, meaning(entry));
}

bool is_run_option(const OptionEntry& entry) {
  return std::find(kRunOptions.begin(), kRunOptions.end(), entry.names.back()) != kRunOptions.end();
}

bool has_all_run_options(const std::vector<OptionEntry>& table) {
  return std::count_if(table.begin(), table.end(), is_run_option) == static_cast<long>(kRunOptions.size());
}

std::string usage(const CLI::App& tool, const std::vector<OptionEntry>& table) {
  std::string text = "lamina " + tool.get_name();
  for (const OptionEntry& entry : table) {
    if (!entry.positional) continue;
    const std::string name = entry.names.front() + (entry.repeatable ? "..." : "");
    text += entry.required ? " " + name : fmt::format(" [{}]", name);
  }
  for (const OptionEntry& entry : table) {
    if (!entry.positional && entry.required) text += fmt::format(" {} {}", entry.names.front(), entry.value);
  }
  return text + " [OPTIONS]";
}

std::string tables(const std::vector<OptionEntry>& entries) {
  std::string text;
  for (const std::string& group : groups_of(entries)) {
    std::string rows;
    for (const OptionEntry& entry : entries)
      if (entry.group == group) rows += row(entry);
    text += fmt::format("\n*{}*\n\n| | default | meaning |\n|---|---|---|\n{}",
                        group == "Positionals" ? "Arguments" : group, rows);
  }
  return text;
}

std::string tool_section(const CLI::App& tool) {
  const std::vector<OptionEntry> table = option_table(tool);
  std::string text = fmt::format("\n## lamina {}\n\n{}.\n\n```\n{}\n```\n", tool.get_name(),
                                 markdown(tool.get_description()), usage(tool, table));
  for (const std::string& note : notes_of(tool)) text += "\n" + markdown(note) + "\n";
  const bool shared = has_all_run_options(table);
  std::vector<OptionEntry> own;
  for (const OptionEntry& entry : table) {
    if (entry.names.back() == "--help" || entry.names.back() == kEverywhere || (shared && is_run_option(entry)))
      continue;
    own.push_back(entry);
    if (entry.positional) own.back().group = "Arguments";
  }
  std::stable_partition(own.begin(), own.end(), [](const OptionEntry& entry) { return entry.positional; });
  text += tables(own);
  if (shared) text += "\nAnd the [run options](#run-options).\n";
  text += "\nExamples:\n\n```\n";
  for (const std::string& line : examples_of(tool)) text += line + "\n";
  return text + "```\n";
}

std::string run_section(const std::vector<const CLI::App*>& tools) {
  std::vector<std::string> without;
  std::vector<OptionEntry> options;
  for (const CLI::App* tool : tools) {
    const std::vector<OptionEntry> table = option_table(*tool);
    if (!has_all_run_options(table)) {
      without.push_back(tool->get_name());
    } else if (options.empty()) {
      std::copy_if(table.begin(), table.end(), std::back_inserter(options),
                   [](const OptionEntry& entry) { return is_run_option(entry) || entry.names.back() == kEverywhere; });
    }
  }
  std::string text = fmt::format(
      "\n## Run options\n\nAll tools but `{}` take these, and every tool takes `{}` ([jobs.md](jobs.md)).\n\n"
      "| | default | meaning |\n|---|---|---|\n",
      fmt::join(without, "`, `"), kEverywhere);
  for (const OptionEntry& entry : options) text += row(entry);
  return text;
}

}  // namespace

std::string reference_page(const CLI::App& app) {
  const std::vector<const CLI::App*> tools = shown_tools(app);
  std::string text(kPreface);
  text += "\n## Tools\n\n| tool | what it does |\n|---|---|\n";
  for (const CLI::App* tool : tools) {
    text += fmt::format("| [{0}](#lamina-{0}) | {1} |\n", tool->get_name(), markdown(tool->get_description()));
  }
  text += run_section(tools);
  for (const CLI::App* tool : tools) text += tool_section(*tool);
  text += "\n## Exit codes\n\n| code | meaning |\n|---|---|\n";
  const auto& meanings = exit_code_meanings();
  for (std::size_t code = 0; code < meanings.size(); ++code)
    text += fmt::format("| {} | {} |\n", code, markdown(meanings.at(code)));
  return text;
}

}  // namespace lamina::tools

#include "common/help.h"

#include <algorithm>
#include <set>
#include <string_view>
#include <utility>

namespace lamina::tools {
namespace {

constexpr std::string_view kExamples = "Examples:\n";

std::vector<std::string> split(std::string_view text, char separator) {
  std::vector<std::string> words;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find(separator, at), text.size());
    words.emplace_back(text.substr(at, end - at));
    at = end + 1;
  }
  return words;
}

/// The lines of the footer before or after the word "Examples:", without indents.
std::vector<std::string> footer_lines(const CLI::App& tool, bool examples) {
  const std::string footer = tool.get_footer();
  const std::size_t word = std::min(footer.find(kExamples), footer.size());
  const std::size_t after = std::min(word + kExamples.size(), footer.size());
  std::vector<std::string> lines;
  for (const std::string& line : split(examples ? footer.substr(after) : footer.substr(0, word), '\n')) {
    const std::size_t text = line.find_first_not_of(' ');
    if (text != std::string::npos) lines.push_back(line.substr(text));
  }
  return lines;
}

/// Placeholders are written in capitals, words to type in small letters.
bool are_words(const std::vector<std::string>& list) {
  return list.size() > 1 && std::all_of(list.begin(), list.end(), [](const std::string& word) {
           return !word.empty() && std::all_of(word.begin(), word.end(), [](char c) {
             return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-';
           });
         });
}

/// Takes "... [what is in brackets]" off the end of a text.
std::string take_bracket(std::string& text) {
  const std::size_t open = text.rfind(" [");
  if (open == std::string::npos || text.back() != ']') return {};
  std::string inside = text.substr(open + 2, text.size() - open - 3);
  text.erase(open);
  return inside;
}

/// The parser adds what its checks say: "TEXT:{a,b}", "N:INT in [0 - 9]". Defaults that it does not know stand in
/// brackets behind the placeholder or the description.
void read_value(const CLI::Option& option, OptionEntry& entry) {
  std::string text = option.get_option_text().empty() ? option.get_type_name() : option.get_option_text();
  const std::size_t range = text.find(" in [");
  if (range != std::string::npos) {
    entry.range = take_bracket(text);
    const std::size_t dash = entry.range.find(" - ");
    if (dash != std::string::npos) entry.range.replace(dash, 3, " to ");
  } else if (const std::string usual = take_bracket(text); !usual.empty()) {
    entry.fallback = usual;
  }
  const std::size_t list = text.find('{');
  if (list != std::string::npos && text.find('}', list) != std::string::npos) {
    entry.choices = split(std::string_view(text).substr(list + 1, text.find('}', list) - list - 1), ',');
    text.clear();
    for (const std::string& word : entry.choices) text += (text.empty() ? "" : "|") + word;
  }
  text = text.substr(0, text.find_first_of(": "));
  if (entry.choices.empty() && are_words(split(text, '|'))) entry.choices = split(text, '|');
  entry.value = text;
}

std::vector<std::string> names_of(const std::set<CLI::Option*>& options) {
  std::vector<std::string> names;
  names.reserve(options.size());
  for (const CLI::Option* option : options) names.push_back(option->get_name());
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace

void add_notes(CLI::App& tool, const std::string& notes) {
  tool.footer(notes);
}

void add_examples(CLI::App& tool, const std::string& examples) {
  const std::string notes = tool.get_footer();
  tool.footer(notes + (notes.empty() ? "" : "\n\n") + std::string(kExamples) + examples);
}

std::vector<std::string> notes_of(const CLI::App& tool) {
  return footer_lines(tool, false);
}

std::vector<std::string> examples_of(const CLI::App& tool) {
  return footer_lines(tool, true);
}

std::vector<OptionEntry> option_table(const CLI::App& tool) {
  std::vector<OptionEntry> table;
  for (const CLI::Option* option : tool.get_options()) {
    if (option->get_group().empty()) continue;
    OptionEntry entry;
    entry.positional = option->get_positional();
    entry.required = option->get_required();
    entry.takes_value = option->get_items_expected_max() > 0;
    entry.repeatable = option->get_items_expected_max() > 1;
    entry.description = option->get_description();
    entry.group = option->get_group();
    entry.fallback = option->get_default_str();
    entry.needs = names_of(option->get_needs());
    entry.excludes = names_of(option->get_excludes());
    if (entry.positional) entry.names.push_back(option->get_name(true));
    for (const std::string& name : option->get_snames()) entry.names.push_back("-" + name);
    for (const std::string& name : option->get_lnames()) entry.names.push_back("--" + name);
    if (entry.takes_value && !entry.positional) read_value(*option, entry);
    if (const std::string usual = take_bracket(entry.description); !usual.empty()) entry.fallback = usual;
    table.push_back(std::move(entry));
  }
  return table;
}

std::vector<std::string> groups_of(const std::vector<OptionEntry>& table) {
  std::vector<std::string> groups;
  for (const OptionEntry& entry : table) {
    if (std::find(groups.begin(), groups.end(), entry.group) == groups.end()) groups.push_back(entry.group);
  }
  return groups;
}

std::vector<const CLI::App*> shown_tools(const CLI::App& app) {
  std::vector<const CLI::App*> tools;
  for (const CLI::App* tool : app.get_subcommands({}))
    if (!tool->get_group().empty()) tools.push_back(tool);
  return tools;
}

const std::array<std::string, 7>& exit_code_meanings() {
  static const std::array<std::string, 7> meanings{
      "done",
      "a defect of the program, or cancelled",
      "options that cannot be meant",
      "input missing, truncated, of another format, or without what the job needs",
      "memory or disk: does not fit, ran out, or the output cannot be written",
      "nothing came out: no surface, no points",
      "lamina check --expect: the mesh is not what was promised"};
  return meanings;
}

}  // namespace lamina::tools

#include "common/help.h"

#include <algorithm>
#include <string_view>

namespace lamina::tools {
namespace {

std::vector<std::string> split(std::string_view text, char separator) {
  std::vector<std::string> words;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find(separator, at), text.size());
    words.emplace_back(text.substr(at, end - at));
    at = end + 1;
  }
  return words;
}

/// Placeholders are written in capitals, words to type in small letters.
bool are_words(const std::vector<std::string>& list) {
  return list.size() > 1 && std::all_of(list.begin(), list.end(), [](const std::string& word) {
           return !word.empty() && std::all_of(word.begin(), word.end(), [](char c) {
             return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-';
           });
         });
}

/// The parser adds what its checks say: "TEXT:{a,b}", "N:INT in [0 - 9]".
void read_value(const CLI::Option& option, OptionEntry& entry) {
  std::string text = option.get_option_text().empty() ? option.get_type_name() : option.get_option_text();
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

}  // namespace

void add_examples(CLI::App& tool, const std::string& lines) {
  tool.footer("Examples:\n" + lines);
}

std::vector<OptionEntry> option_table(const CLI::App& tool) {
  std::vector<OptionEntry> table;
  for (const CLI::Option* option : tool.get_options()) {
    if (option->get_group().empty()) continue;
    OptionEntry entry;
    entry.positional = option->get_positional();
    entry.required = option->get_required();
    entry.takes_value = option->get_items_expected_max() > 0;
    entry.description = option->get_description();
    entry.group = option->get_group();
    entry.fallback = option->get_default_str();
    if (entry.positional) entry.names.push_back(option->get_name(true));
    for (const std::string& name : option->get_snames()) entry.names.push_back("-" + name);
    for (const std::string& name : option->get_lnames()) entry.names.push_back("--" + name);
    if (entry.takes_value && !entry.positional) read_value(*option, entry);
    table.push_back(std::move(entry));
  }
  return table;
}

std::vector<const CLI::App*> shown_tools(const CLI::App& app) {
  std::vector<const CLI::App*> tools;
  for (const CLI::App* tool : app.get_subcommands({}))
    if (!tool->get_group().empty()) tools.push_back(tool);
  return tools;
}

}  // namespace lamina::tools

// A tool's help: what it says beside its options, and the options as data, read back from the parser, from which
// completion, manual pages and docs/reference.md are made.
#pragma once
#include <CLI/CLI.hpp>
#include <array>
#include <string>
#include <vector>

namespace lamina::tools {

/// Ends a tool's help. `notes`: facts that belong to no single option, a paragraph a line. `examples`: command lines,
/// indented, that work as they stand (the tests run them).
void add_notes(CLI::App& tool, const std::string& notes);
void add_examples(CLI::App& tool, const std::string& examples);

/// What was added by these, line by line and not indented.
std::vector<std::string> notes_of(const CLI::App& tool);
std::vector<std::string> examples_of(const CLI::App& tool);

struct OptionEntry {
  std::vector<std::string> names;    ///< with their dashes, short ones first; a positional's own name
  std::string value;                 ///< what it takes: LENGTH, x|y|z; empty for flags and positionals
  std::vector<std::string> choices;  ///< the words it takes, where they are a fixed list
  std::string description, group;
  std::string fallback;                      ///< value without the option
  std::string range;                         ///< "1 to 8", where the parser checks it
  std::vector<std::string> needs, excludes;  ///< other options, by a name with its dashes
  bool positional = false, required = false, takes_value = false;
  bool repeatable = false;  ///< takes several values
};

/// In the order of the help; options that are not shown there are left out.
std::vector<OptionEntry> option_table(const CLI::App& tool);
/// The groups of the entries, in order.
std::vector<std::string> groups_of(const std::vector<OptionEntry>& table);

/// The tools a user is meant to see.
std::vector<const CLI::App*> shown_tools(const CLI::App& app);

/// What the program's exit codes mean; the index is the code.
const std::array<std::string, 7>& exit_code_meanings();

/// docs/reference.md: every option of every tool.
std::string reference_page(const CLI::App& app);

}  // namespace lamina::tools

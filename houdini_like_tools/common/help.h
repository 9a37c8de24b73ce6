// A tool's help: the examples that end it, and its options as data, read back from the parser, from which completion,
// manual pages and the reference are made.
#pragma once
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace lamina::tools {

/// What a tool's help ends with: command lines that work as they stand (the tests run them).
void add_examples(CLI::App& tool, const std::string& lines);

struct OptionEntry {
  std::vector<std::string> names;    ///< with their dashes, short ones first; a positional's own name
  std::string value;                 ///< what it takes: LENGTH, x|y|z; empty for flags and positionals
  std::vector<std::string> choices;  ///< the words it takes, where they are a fixed list
  std::string description, group;
  std::string fallback;  ///< value without the option, where the parser knows it
  bool positional = false, required = false, takes_value = false;
};

/// In the order of the help; options that are not shown there are left out.
std::vector<OptionEntry> option_table(const CLI::App& tool);

/// The tools a user is meant to see.
std::vector<const CLI::App*> shown_tools(const CLI::App& app);

}  // namespace lamina::tools

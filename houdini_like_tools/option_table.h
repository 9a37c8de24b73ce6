// The options of a tool as data, read back from the parser: what completion and manual pages are made from.
#pragma once
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace lamina::tools {

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

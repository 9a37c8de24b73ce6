// A tool's options as JSON and back: the steps of job files. It knows no tool: names, kinds of values and checks are
// read from the parser, so that new options are keys at once.
#pragma once
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace lamina::tools {

using Json = nlohmann::ordered_json;

/// What was given of the options: numbers as numbers, flags as true or false, a list where several values are taken,
/// everything else as text. Keys are the long names without dashes, arguments' names in small letters.
Json values_of(CLI::App& tool);

/// Gives the options what `values` says, as if typed. The tool must not have been parsed. Throws Error(usage) naming
/// the key: one that there is not (and the nearest that there is), a value of the wrong kind, one out of range, a
/// missing one.
void take_values(CLI::App& tool, const Json& values);

/// A file or folder that a value names. Arguments are read; options mostly written.
struct NamedFile {
  std::string key, name;
  bool argument = false;
};
/// Of values that take_values() accepts.
std::vector<NamedFile> files_of(CLI::App& tool, const Json& values);

/// A parser's message about options with the names of keys: '--blend' becomes 'blend' in quotes.
std::string about_keys(const std::string& message);

}  // namespace lamina::tools

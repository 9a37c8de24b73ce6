// A tool's options as JSON and back: the steps of job files. It knows no tool: names, kinds of values and checks are
// read from the parser, so that new options are keys at once.
#pragma once
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <string>
#include <vector>

#include "common/command_line.h"

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

// Job files: runs of tools, one after another, as JSON (docs/jobs.md).

/// Adds `lamina run`, which runs a job's steps by the given tools, and to it and every tool that a user sees
/// --print-job, which prints the command line as a job. `app` has its tools already.
void add_jobs(CLI::App& app, const std::vector<AddTool>& tools);

}  // namespace lamina::tools

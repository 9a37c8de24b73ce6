// The command line of the whole program: parse, answer mistakes, and turn what comes out into an exit code.
#pragma once
#include <CLI/CLI.hpp>
#include <vector>

namespace lamina::tools {

using AddTool = void (*)(CLI::App&);

/// Runs the program with the given tools. Messages go to standard error, help and version to standard output; the
/// result is the process's exit code (lamina/error.h).
int run_program(int argc, const char* const* argv, const std::vector<AddTool>& tools);

}  // namespace lamina::tools

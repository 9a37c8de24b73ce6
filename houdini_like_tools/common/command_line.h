// The command line of the whole program: parse, answer mistakes, and turn what comes out into an exit code.
#pragma once
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "lamina/error.h"

namespace lamina::tools {

using AddTool = void (*)(CLI::App&);

/// What went wrong, for the user: one line.
struct Failure {
  ExitCode code = ExitCode::internal;
  std::string reason;
};
/// Of the exception that is being handled.
Failure failure_in_flight();

/// Runs the program with the given tools. Messages go to standard error, help and version to standard output; the
/// result is the process's exit code (lamina/error.h).
int run_program(int argc, const char* const* argv, const std::vector<AddTool>& tools);

}  // namespace lamina::tools

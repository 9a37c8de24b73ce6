// Job files: runs of tools, one after another, as JSON (docs/jobs.md).
#pragma once
#include <CLI/CLI.hpp>
#include <vector>

#include "common/command_line.h"

namespace lamina::tools {

/// Adds `lamina run`, which runs a job's steps by the given tools, and to it and every tool that a user sees
/// --print-job, which prints the command line as a job. `app` has its tools already.
void add_jobs(CLI::App& app, const std::vector<AddTool>& tools);

}  // namespace lamina::tools

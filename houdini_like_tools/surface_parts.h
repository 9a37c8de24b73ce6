// What `lamina surface` can do beside running at once: one chunk of a farm's job, the list of its tasks, checkpoints.
#pragma once
#include <CLI/CLI.hpp>
#include <string>

#include "lamina/chunk.h"
#include "lamina/run.h"
#include "lamina/surface.h"

namespace lamina::tools {

struct PartsOptions {
  Chunk chunk;
  bool chunked = false;
  Checkpoint checkpoint;
  int tasks = 0;  ///< to print; 0: none
  bool json = false;
};

/// Adds --chunk, --print-tasks, --json, --checkpoint and --resume in the group "Parts". `options` must outlive the
/// parse.
void add_parts_options(CLI::App& tool, PartsOptions& options);

/// Runs as the options ask for.
SurfaceStats run_parts(const SurfaceSettings& settings, const PartsOptions& options, const RunContext& context);

/// Prints the command lines that make `output` out of the store `input` in options.tasks chunks, with the options the
/// tool was given. Throws Error(usage) for outputs that parts cannot lie beside.
void print_tasks(const CLI::App& tool, const std::string& input, const std::string& output,
                 const PartsOptions& options);

}  // namespace lamina::tools

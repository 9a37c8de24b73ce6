// `lamina surface` in parts: one chunk of a farm's job, the list of its tasks, checkpoints, and several processes that
// mpirun started.
#pragma once
#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "lamina/chunk.h"
#include "lamina/ranks.h"
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

struct PartsResult {
  SurfaceStats surface;
  std::optional<ChunkStats> chunk;  ///< where one was asked for
};

/// Runs as the options ask for.
PartsResult run_parts(const SurfaceSettings& settings, const PartsOptions& options, const RunContext& context);

/// Runs this process's share. Throws Error(usage) for options that several processes cannot meet together.
RanksStats run_ranks(const SurfaceSettings& settings, const PartsOptions& parts, const RunContext& context);

/// A line per rank, for the reader.
void report_ranks(const std::vector<RankStats>& ranks, const RunContext& context);

/// Prints the command lines that make `outputs` out of the store `input` in options.tasks chunks, with the options the
/// tool was given. Throws Error(usage) for outputs that parts cannot lie beside.
void print_tasks(const CLI::App& tool, const std::string& input, const std::vector<std::string>& outputs,
                 const PartsOptions& options);

}  // namespace lamina::tools

// The files that the tools read: options, streams, and what is too large.
#pragma once
#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "lamina/info.h"
#include "lamina/mesh.h"
#include "lamina/points.h"
#include "lamina/run.h"
#include "lamina/surface.h"

namespace lamina::tools {

/// `name`, or "-" where it stands for standard input or output with the format given by its ending: stdin.ply,
/// stdout.ply. A file of that name is ./stdin.ply.
std::string pipe_name(const std::string& name);

/// --bad-samples drop|refuse, in the group "Input"; `what` may be bad.
void add_bad_samples(CLI::App& app, BadSamples& bad, const std::string& what = "Points");
/// How point files are read and what is taken of them: PointSettings.
void add_point_options(CLI::App& app, PointSettings& reading, const std::string& group = "Input");

/// open_points() with all fields of the records, saying what the reader found worth saying.
std::unique_ptr<PointSource> open_point_input(const std::string& path, const PointSettings& reading,
                                              const RunContext& context);

/// "standard input" for "-".
std::string shown_name(const std::string& path);

/// read_mesh(), also from standard input. Meshes are held whole: throws Error(budget) when the file is too large for
/// context.max_memory.
TriangleMesh read_mesh_input(const std::string& path, const RunContext& context,
                             NonFinite non_finite = NonFinite::refuse);

/// The same for tools with --bad-samples: vertices that are not finite are refused, or left out, which is told.
TriangleMesh read_mesh_input(const std::string& path, const RunContext& context, BadSamples bad);

/// A mesh's vertices as points.
SampleBatch vertices_of(const TriangleMesh& mesh);

}  // namespace lamina::tools

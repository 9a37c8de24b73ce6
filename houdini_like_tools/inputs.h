// What the tools share about the files they read and write.
#pragma once
#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <string_view>

#include "console.h"
#include "lamina/info.h"
#include "lamina/mesh.h"
#include "lamina/points.h"
#include "lamina/points_writer.h"
#include "lamina/surface.h"
#include "lamina/volume_edit.h"

namespace lamina::tools {

/// How positions are written.
enum class Precision { automatic, single_precision, double_precision };

/// --precision auto|float|double, in the group "Output".
void add_precision(CLI::App& app, Precision& precision);
/// --bad-samples drop|refuse, in the group "Input"; `what` may be bad.
void add_bad_samples(CLI::App& app, BadSamples& bad, const std::string& what = "Points");
/// INPUT and -o, --output, both required; `formats` says what they can be.
void add_files(CLI::App& app, std::string& input, const std::string& input_formats, std::string& output,
               const std::string& output_formats);

/// The columns with their positions in the precision asked for.
PointColumns with_precision(PointColumns columns, Precision precision);

/// --columns NAMES, in the group "Input": PointSettings::columns.
void add_columns(CLI::App& app, std::string& columns);

/// open_points(), saying what the reader found worth saying.
std::unique_ptr<PointSource> open_point_input(const std::string& path, const std::string& columns,
                                              const RunContext& context);

/// "standard input" for "-".
std::string shown_name(const std::string& path);

/// "kept 2 grids of 1.2 M voxels and 300 points, 4.5 MB".
std::string volume_text(std::string_view verb, const VolumeEditStats& stats);

/// read_mesh(), also from standard input. Meshes are held whole: throws Error(budget) when the file is too large for
/// context.max_memory.
TriangleMesh read_mesh_input(const std::string& path, const RunContext& context,
                             NonFinite non_finite = NonFinite::refuse);

/// The same for tools with --bad-samples: vertices that are not finite are refused, or left out, which is told.
TriangleMesh read_mesh_input(const std::string& path, const RunContext& context, BadSamples bad);

/// What a tool's help ends with: command lines that work as they stand (the tests run them).
void add_examples(CLI::App& tool, const std::string& lines);

}  // namespace lamina::tools

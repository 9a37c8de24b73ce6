// Options and results of the tools, for whoever runs them without a command line, too. Each function lies with its
// tool.
#pragma once
#include <CLI/CLI.hpp>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "common/model.h"
#include "lamina/measure.h"
#include "lamina/normals.h"
#include "lamina/point_radii.h"
#include "lamina/points.h"
#include "lamina/render.h"
#include "lamina/run.h"
#include "lamina/simplify.h"
#include "lamina/volume.h"

namespace lamina::tools {

/// How far a mesh is to be simplified: one of these.
struct SimplifyGoal {
  std::optional<std::uint64_t> triangles;
  std::optional<double> ratio, error, deviation;
  [[nodiscard]] bool given() const { return triangles || ratio || error || deviation; }
};
/// --error, --triangles, --ratio; --deviation is the tool's own affair, and excludes these.
void add_simplify_goal(CLI::App& tool, SimplifyGoal& goal, const std::string& group);
/// Throws Error(usage) where none is given, or out of range.
SimplifySettings simplify_settings(const SimplifyGoal& goal);
/// How many triangles are left, and whether more than were wanted.
void report_simplified(const SimplifyStats& stats, const std::string& name, const RunContext& context);

/// --voxelsize, --halfbandvoxels, --sign, --name, --no-colour, --half.
void add_grid_options(CLI::App& tool, VolumeSettings& settings);

/// --density, --particlescale, --minradius, --maxradius.
void add_radius_options(CLI::App& tool, PointRadiiSettings& settings);

/// How `lamina normal` finds normals.
struct NormalFinding {
  NormalsSettings settings;
  bool reorient = false, check = false, missing = false;
  std::optional<Trade> preset;
};
/// --reorient, --missing, --check, --preset, and how normals are found.
void add_normal_finding(CLI::App& tool, NormalFinding& finding);
/// The options given come to these settings. Throws Error(usage) for those that exclude each other.
NormalsSettings normals_settings(CLI::App& tool, const NormalFinding& finding, const RunContext& context);
/// Those of clouds that look like a trade's, where no preset says which, and says so.
void guess_facing(const PointSourceInfo& info, NormalsSettings& settings, const RunContext& context);

/// --count, --vertices, --seed.
void add_compare_options(CLI::App& tool, CompareSettings& settings);
nlohmann::ordered_json compare_json(const CompareResult& result);

nlohmann::ordered_json check_json(const CheckReport& report);
/// Throws Error(check_failed) where the mesh is not as expected: "manifold", "closed" or empty.
void require_expected(const std::string& mesh, const std::string& expect, const CheckReport& report);

nlohmann::ordered_json measure_json(const MeshMeasures& measures);

/// What a picture of `lamina render` looks like.
struct PictureOptions {
  RenderSettings settings;
  ModelOptions model;
};
/// All but input and output.
void add_picture_options(CLI::App& tool, PictureOptions& o);
/// Throws CLI::ValidationError where options do not go together.
void require_together(const PictureOptions& o);

}  // namespace lamina::tools

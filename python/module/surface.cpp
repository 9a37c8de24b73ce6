// lamina.surface and its sisters: points to a mesh, in memory or in files.
#include "surface.h"

#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "arrays.h"
#include "common/stats.h"
#include "functions.h"
#include "keywords.h"
#include "lamina/chunk.h"
#include "lamina/error.h"
#include "lamina/surface.h"
#include "mesh.h"
#include "run.h"
#include "surface_call.h"

namespace lamina::python {
namespace {

/// Of a run on arrays, input names nothing that is there.
std::string statistics(const SurfaceStats& stats, const SurfaceSettings& settings) {
  return tools::stats_json(stats, settings).dump();
}

Mesh surface(const py::object& points, const py::object& normals, const py::object& radius, const py::dict& attributes,
             const py::object& progress, const py::kwargs& keywords) {
  SurfaceCall call("surface", SurfaceCall::in_memory(), keywords);
  const PointArguments input(points, normals, radius, attributes);
  const auto collector = std::make_shared<MeshCollector>();
  run_job(call.run_options(), progress, [&](const RunContext& context) {
    SurfaceSettings settings = call.settings(input, context);
    settings.receiver = collector;
    const SurfaceStats stats = reconstruct_surface(settings, context);
    collector->data()->statistics = statistics(stats, settings);
  });
  return {collector->data()};
}

py::object surface_to_file(const py::object& points, const py::object& output, const py::object& normals,
                           const py::object& radius, const py::dict& attributes, const py::object& progress,
                           const py::kwargs& keywords) {
  SurfaceCall call("surface_to_file", {"dry-run"}, keywords);
  const PointArguments input(points, normals, radius, attributes);
  const std::vector<std::string> outputs = paths_of(output);
  if (outputs.empty()) throw py::type_error("surface_to_file: output must be a path, or several");
  std::string text;
  run_job(call.run_options(), progress, [&](const RunContext& context) {
    SurfaceSettings settings = call.settings(input, context);
    settings.output = outputs.front();
    settings.more_outputs.assign(outputs.begin() + 1, outputs.end());
    const Checkpoint& checkpoint = call.checkpoint();
    if (!checkpoint.directory.empty() && input.are_arrays())
      throw Error(ExitCode::usage, "checkpoint: a run that is to go on reads its points again; give it files");
    const SurfaceStats stats = checkpoint.directory.empty() ? reconstruct_surface(settings, context)
                                                            : reconstruct_resumable(settings, checkpoint, context);
    text = statistics(stats, settings);
  });
  return from_json(text);
}

py::object plan(const py::object& points, const py::object& normals, const py::object& radius,
                const py::dict& attributes, const py::object& progress, const py::kwargs& keywords) {
  SurfaceCall call("plan", SurfaceCall::in_memory(), keywords);
  const PointArguments input(points, normals, radius, attributes);
  std::string text;
  run_job(call.run_options(), progress, [&](const RunContext& context) {
    SurfaceSettings settings = call.settings(input, context);
    settings.dry_run = true;
    text = statistics(reconstruct_surface(settings, context), settings);
  });
  return from_json(text);
}

constexpr const char* kPoints = R"(
points: (n, 3) float32 or float64 array, in any layout, read where it lies; or the path of a file, folder, pattern or
    scan list, or a list of these, which are one cloud.
normals: (n, 3) float32 or float64, of any length, facing outwards; None: they are found.
radius: (n,) influence radii in the units of the points, or one number; None: from the density.
attributes: name -> (n,) array of integers of 1, 2 or 4 bytes, float32 or float64, which arrive at the vertices; colors
    of (n, 3) or (n, 4) are red, green, blue and alpha; quality weighs the points.
progress: called as progress(stage, done, left), done from 0 to 1, left in seconds or None; False from it cancels.

Arrays must not be changed before the call returns. Other threads of Python run meanwhile.

Raises lamina.Error with the program's message and exit_code (2: a keyword's value, 3: an input, 4: memory or disk,
5: no surface, 1: cancelled), TypeError or ValueError for arrays of another type or shape, and unknown keywords.

The other keywords are the options of `lamina surface`, lengths in the units of the points or as '0.6r':

)";

}  // namespace

SurfaceCall::SurfaceCall(const std::string& function, const std::vector<std::string>& without,
                         const py::kwargs& keywords)
    : words_(function) {
  words_.leave_out({"chunk", "print-tasks", "stats", "preview"});
  words_.leave_out(without);
  tools::add_surface_options(words_.app(), options_);
  words_.parse(keywords);
}

std::vector<std::string> SurfaceCall::in_memory() {
  return {"checkpoint", "resume", "dry-run", "tiles", "tiles-plain"};
}

SurfaceSettings SurfaceCall::settings(const PointArguments& input, const RunContext& context) {
  options_.inputs = input.files();
  SurfaceSettings settings = tools::surface_settings(options_, context);
  settings.input = PointArguments::kName;
  if (input.are_arrays()) {
    settings.open = [&input] { return input.view(); };
    return settings;
  }
  settings.input = input.files().front();
  settings.more_inputs.assign(input.files().begin() + 1, input.files().end());
  return settings;
}

SurfaceSettings SurfaceCall::settings(const RunContext& context) {
  SurfaceSettings settings = tools::surface_settings(options_, context);
  settings.input = PointArguments::kName;
  return settings;
}

void add_surface_functions(py::module_& module) {
  SurfaceCall described("surface", SurfaceCall::in_memory(), py::kwargs());
  described.list_in(module);
  SurfaceCall("surface_to_file", {"dry-run"}, py::kwargs()).list_in(module);
  const std::string keywords = kPoints + described.describe();
  module.def(
      "surface", &surface, py::arg("points"), py::arg("normals") = py::none(), py::arg("radius") = py::none(),
      py::arg("attributes") = py::dict(), py::kw_only(), py::arg("progress") = py::none(),
      ("Reconstructs the surface of points as a Mesh: the same bytes that the program writes.\n" + keywords).c_str());
  module.def(
      "surface_to_file", &surface_to_file, py::arg("points"), py::arg("output"), py::arg("normals") = py::none(),
      py::arg("radius") = py::none(), py::arg("attributes") = py::dict(), py::kw_only(),
      py::arg("progress") = py::none(),
      ("Streams the surface of points into a file, or several of other formats, and returns the statistics.\n\n"
       "The mesh is never held: memory goes with the cross-section of the cloud. output: .ply, .obj, .off, .stl or "
       ".glb.\n" +
       keywords)
          .c_str());
  module.def("plan", &plan, py::arg("points"), py::arg("normals") = py::none(), py::arg("radius") = py::none(),
             py::arg("attributes") = py::dict(), py::kw_only(), py::arg("progress") = py::none(),
             ("Reads points and returns what surface() would do and take, without doing it: a dict, as the program's "
              "--dry-run --stats.\n" +
              keywords)
                 .c_str());
}

}  // namespace lamina::python

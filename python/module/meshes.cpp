// lamina.check, lamina.measure, lamina.compare, lamina.simplify: meshes judged and thinned.
#include <nlohmann/json.hpp>

#include <memory>
#include <string>
#include <utility>

#include "common/console.h"
#include "functions.h"
#include "keywords.h"
#include "lamina/error.h"
#include "lamina/measure.h"
#include "lamina/simplify.h"
#include "mesh.h"
#include "run.h"
#include "tables.h"

namespace lamina::python {
namespace {

constexpr const char* kName = "mesh";

tools::RunOptions on_threads(int threads) {
  tools::RunOptions run;
  run.threads = threads;
  return run;
}

void require_faces(const MeshData& mesh) {
  if (mesh.geometry.triangles.empty())
    throw Error(ExitCode::unreadable, "the mesh has no faces: a point cloud, not a mesh");
}

py::object check(const py::object& mesh, const std::string& expect, int threads) {
  if (!expect.empty() && expect != "manifold" && expect != "closed")
    throw py::value_error("expect must be 'manifold' or 'closed'");
  const std::shared_ptr<MeshData> data = mesh_argument(mesh);
  CheckReport report;
  run_job(on_threads(threads), py::none(), [&](const RunContext& context) {
    require_faces(*data);
    report = check_mesh(data->geometry, context);
    tools::require_expected(kName, expect, report);
  });
  return from_json(tools::check_json(report).dump());
}

py::object measure(const py::object& mesh, int threads) {
  const std::shared_ptr<MeshData> data = mesh_argument(mesh);
  MeshMeasures measures;
  run_job(on_threads(threads), py::none(),
          [&](const RunContext& context) { measures = measure_mesh(data->geometry, context); });
  return from_json(tools::measure_json(measures).dump());
}

py::object compare_meshes(const py::object& a, const py::object& b, const py::object& progress,
                          const py::kwargs& keywords) {
  Keywords words("compare");
  CompareSettings settings;
  tools::RunOptions run;
  tools::add_compare_options(words.app(), settings);
  tools::add_run_options(words.app(), run);
  words.parse(keywords);
  const std::shared_ptr<MeshData> mine = mesh_argument(a), truth = mesh_argument(b);
  CompareResult result;
  run_job(run, progress,
          [&](const RunContext& context) { result = compare(mine->geometry, truth->geometry, settings, context); });
  return from_json(tools::compare_json(result).dump());
}

Mesh simplify(const py::object& mesh, const py::object& progress, const py::kwargs& keywords) {
  Keywords words("simplify");
  tools::SimplifyGoal goal;
  tools::RunOptions run;
  tools::add_simplify_goal(words.app(), goal, "Goal");
  tools::add_run_options(words.app(), run);
  words.parse(keywords);
  const std::shared_ptr<MeshData> data = mesh_argument(mesh);
  std::shared_ptr<MeshData> simpler;
  run_job(run, progress, [&](const RunContext& context) {
    require_faces(*data);
    TriangleMesh copy = WithAttributes(data).mesh();
    const SimplifyStats stats = simplify_mesh(copy, tools::simplify_settings(goal), context);
    if (!stats.reached)
      context.warn("more triangles stay than were wanted: no other edge can go without a fold or a change of topology");
    simpler = std::make_shared<MeshData>(std::move(copy));
  });
  return {simpler};
}

}  // namespace

void add_mesh_functions(py::module_& module) {
  Keywords comparing("compare"), simplifying("simplify");
  CompareSettings settings;
  tools::SimplifyGoal goal;
  tools::RunOptions run;
  tools::add_compare_options(comparing.app(), settings);
  tools::add_run_options(comparing.app(), run);
  comparing.list_in(module);
  tools::add_simplify_goal(simplifying.app(), goal, "Goal");
  tools::add_run_options(simplifying.app(), run);
  simplifying.list_in(module);
  module.def("check", &check, py::arg("mesh"), py::kw_only(), py::arg("expect") = "", py::arg("threads") = 0,
             R"(Is a mesh finite, manifold, oriented, closed? A dict of counts, as of `lamina check --json`.

mesh: a Mesh or a path. expect: 'manifold' or 'closed', raises lamina.Error, exit_code 6, where it is not.)");
  module.def("measure", &measure, py::arg("mesh"), py::kw_only(), py::arg("threads") = 0,
             R"(Area, volume, edges, curvature and parts of a mesh: a dict, as of `lamina measure --json`.

mesh: a Mesh or a path. Lengths are in its units.)");
  module.def("compare", &compare_meshes, py::arg("mesh"), py::arg("truth"), py::kw_only(),
             py::arg("progress") = py::none(),
             R"(Two-sided distance between a mesh and the truth: a dict, as of `lamina compare --json`.

mesh, truth: each a Mesh or a path; one without faces is a cloud. count: samples a side; vertices: measure at the
vertices instead; seed; threads.)");
  module.def("simplify", &simplify, py::arg("mesh"), py::kw_only(), py::arg("progress") = py::none(),
             R"(The mesh with fewer triangles for the same surface; the given one stays as it is.

One of error (a length that it may get away), triangles (how many stay) and ratio (which share stays, up to 1).
mesh: a Mesh or a path, manifold.)");
}

}  // namespace lamina::python

// lamina check: is the mesh finite, manifold, oriented, closed?
#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "common/help.h"
#include "common/inputs.h"
#include "lamina/error.h"
#include "lamina/measure.h"
#include "tables.h"
#include "tool.h"

namespace lamina::tools {
namespace {

struct CheckOptions {
  std::string mesh, expect;
  RunContext run;
  bool json = false;
};

void print_table(const CheckReport& r) {
  const auto row = [](const char* label, const auto& value) { fmt::print("{:<26} {:>12}\n", label, value); };
  row("vertices", r.vertices);
  row("  unreferenced", r.unreferenced_vertices);
  row("  duplicate", r.duplicate_vertices);
  row("  not finite", r.non_finite_vertices);
  row("  non-manifold", r.non_manifold_vertices);
  row("edges", r.edges);
  row("  non-manifold", r.non_manifold_edges);
  row("  inconsistently oriented", r.inconsistent_edges);
  row("  boundary", r.boundary_edges);
  row("boundary loops", r.boundary_loops);
  if (r.boundary_loops > 0)
    fmt::print("{:<26} {:>12} edges, length {:.6g}\n", "  longest", r.longest_loop_edges, r.longest_loop_length);
  row("triangles", r.triangles);
  row("  duplicate", r.duplicate_triangles);
  row("  naming a vertex twice", r.repeated_index_triangles);
  row("  of zero area", r.zero_area_triangles);
  row("components", r.components);
  fmt::print("{:<26} {:>12} triangles, {} boundary edges\n", "  largest", r.largest_component_triangles,
             r.largest_component_boundary_edges);
  row("Euler characteristic", r.euler_characteristic);
  if (r.genus) row("genus", *r.genus);
  row("manifold", r.manifold() ? "yes" : "no");
  row("closed", r.closed() ? "yes" : "no");
}

/// What keeps the mesh from being manifold or closed, in words.
std::string objections(const CheckReport& r, bool closed) {
  std::string text;
  const auto add = [&](std::uint64_t n, const char* what) {
    if (n > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", n, what);
  };
  add(r.non_finite_vertices, "vertices that are not finite");
  add(r.non_manifold_edges, "non-manifold edges");
  add(r.non_manifold_vertices, "non-manifold vertices");
  add(r.inconsistent_edges, "inconsistently oriented edges");
  add(r.duplicate_triangles, "duplicate triangles");
  add(r.repeated_index_triangles, "triangles naming a vertex twice");
  if (closed) add(r.boundary_edges, "boundary edges");
  return text;
}

void print_json(const std::string& mesh, const CheckReport& report) {
  nlohmann::ordered_json j{{"mesh", mesh}};
  j.update(check_json(report));
  fmt::print("{}\n", j.dump(2));
}

void run_check(const CheckOptions& o) {
  const TriangleMesh mesh = read_mesh_input(o.mesh, o.run, NonFinite::keep);
  if (mesh.triangles.empty())
    throw Error(ExitCode::unreadable,
                fmt::format("{}: has no faces: a point cloud, not a mesh; 'lamina surface' makes one of it", o.mesh));
  const CheckReport report = check_mesh(mesh, o.run);
  if (o.json)
    print_json(o.mesh, report);
  else
    print_table(report);
  require_expected(o.mesh, o.expect, report);
}

}  // namespace

nlohmann::ordered_json check_json(const CheckReport& r) {
  nlohmann::ordered_json j{{"vertices", r.vertices},
                           {"triangles", r.triangles},
                           {"edges", r.edges},
                           {"non_finite_vertices", r.non_finite_vertices},
                           {"unreferenced_vertices", r.unreferenced_vertices},
                           {"duplicate_vertices", r.duplicate_vertices},
                           {"non_manifold_edges", r.non_manifold_edges},
                           {"non_manifold_vertices", r.non_manifold_vertices},
                           {"inconsistent_edges", r.inconsistent_edges},
                           {"repeated_index_triangles", r.repeated_index_triangles},
                           {"zero_area_triangles", r.zero_area_triangles},
                           {"duplicate_triangles", r.duplicate_triangles},
                           {"boundary_edges", r.boundary_edges},
                           {"boundary_loops", r.boundary_loops},
                           {"longest_loop_edges", r.longest_loop_edges},
                           {"longest_loop_length", r.longest_loop_length},
                           {"components", r.components},
                           {"largest_component_triangles", r.largest_component_triangles},
                           {"largest_component_boundary_edges", r.largest_component_boundary_edges},
                           {"euler_characteristic", r.euler_characteristic}};
  if (r.genus)
    j["genus"] = *r.genus;
  else
    j["genus"] = nullptr;
  j["manifold"] = r.manifold();
  j["closed"] = r.closed();
  return j;
}

void require_expected(const std::string& mesh, const std::string& expect, const CheckReport& report) {
  const bool met = expect.empty() || (expect == "closed" ? report.closed() : report.manifold());
  if (!met)
    throw Error(ExitCode::check_failed,
                fmt::format("{}: not {}: {}", mesh, expect, objections(report, expect == "closed")));
}

void add_check(CLI::App& app) {
  auto* tool = app.add_subcommand("check", "Check that a mesh is finite, manifold, oriented and closed");
  auto o = std::make_shared<CheckOptions>();
  tool->add_option("MESH", o->mesh, "Mesh to check: .ply .obj .off .stl .glb, each also as .gz")
      ->required()
      ->type_name("");
  tool->add_option("--expect", o->expect,
                   "Exit with 6 when the mesh is not manifold, or not closed (manifold without boundary)")
      ->check(CLI::IsMember({"manifold", "closed"}).description(""))
      ->type_name("manifold|closed");
  tool->add_option("--threads", o->run.threads, "Number of threads; 0 is every core")
      ->type_name("N")
      ->capture_default_str()
      ->group("Run");
  tool->add_flag("--json", o->json, "Print JSON");
  add_notes(*tool, "The mesh is held in memory.");
  add_examples(*tool, "  lamina check mesh.ply --expect manifold");
  tool->callback([o] { run_check(*o); });
}

}  // namespace lamina::tools

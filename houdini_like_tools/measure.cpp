// lamina measure: area, volume, edges, curvature and parts of a mesh.
#include "lamina/measure.h"

#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "common/console.h"
#include "common/help.h"
#include "common/inputs.h"
#include "lamina/error.h"
#include "tables.h"
#include "tool.h"

namespace lamina::tools {
namespace {

constexpr std::size_t kPartsShown = 10;

struct MeasureOptions {
  std::string mesh;
  bool json = false;
  RunOptions run;
};

void print_table(const MeshMeasures& m) {
  const auto row = [](const char* label, const std::string& value) { fmt::print("{:<24} {}\n", label, value); };
  const auto vector = [](const std::array<double, 3>& v) {
    return fmt::format("{:.9g} {:.9g} {:.9g}", v[0], v[1], v[2]);
  };
  row("vertices", fmt::format("{}", m.vertices));
  row("triangles", fmt::format("{}", m.triangles));
  row("edges", fmt::format("{}", m.edges));
  row("box", vector(m.low) + "  to  " + vector(m.high));
  row("size", vector({m.high[0] - m.low[0], m.high[1] - m.low[1], m.high[2] - m.low[2]}));
  row("centroid", vector(m.centroid));
  row("area", fmt::format("{:.9g}", m.area));
  row("volume", m.volume ? fmt::format("{:.9g}", *m.volume) : "none: not closed");
  row("edge length",
      fmt::format("{:.4g} (shortest {:.4g}, longest {:.4g})", m.mean_edge, m.shortest_edge, m.longest_edge));
  row("boundary", fmt::format("{} edges, length {:.6g}", m.boundary_edges, m.boundary_length));
  row("Gaussian curvature", fmt::format("{:.6g} in all", m.total_gaussian_curvature));
  row("mean curvature", fmt::format("{:.6g} on average, without sign", m.mean_absolute_mean_curvature));
  row("parts", fmt::format("{}", m.parts.size()));
  for (std::size_t i = 0; i < m.parts.size() && i < kPartsShown; ++i) {
    const MeshPart& p = m.parts[i];
    row(fmt::format("  part {}", i + 1).c_str(),
        fmt::format("{} triangles, area {:.6g}, {}", p.triangles, p.area,
                    p.closed ? fmt::format("volume {:.6g}", p.volume) : "open"));
  }
  if (m.parts.size() > kPartsShown) fmt::print("  and {} smaller ones: see --json\n", m.parts.size() - kPartsShown);
}

void run_measure(const MeasureOptions& o) {
  const RunContext context = make_context(o.run);
  if (content_of(o.mesh, o.run.tmp_dir) == FileContent::points)
    throw Error(ExitCode::unreadable, fmt::format("{}: holds points; only meshes have an area ('lamina info' tells "
                                                  "where points lie)",
                                                  shown_name(o.mesh)));
  const TriangleMesh mesh = read_mesh_input(o.mesh, context);
  MeshMeasures measures;
  try {
    measures = measure_mesh(mesh, context);
  } catch (const Error& e) {
    throw Error(e.code(), shown_name(o.mesh) + ": " + e.what());  // the library knows the mesh, not its name
  }
  if (o.json) {
    nlohmann::ordered_json j{{"mesh", o.mesh}};
    j.update(measure_json(measures));
    fmt::print("{}\n", j.dump(2));
  } else {
    print_table(measures);
  }
}

}  // namespace

nlohmann::ordered_json measure_json(const MeshMeasures& m) {
  nlohmann::ordered_json j{{"vertices", m.vertices},
                           {"triangles", m.triangles},
                           {"edges", m.edges},
                           {"boundary_edges", m.boundary_edges},
                           {"low", m.low},
                           {"high", m.high},
                           {"centroid", m.centroid},
                           {"area", m.area},
                           {"boundary_length", m.boundary_length}};
  if (m.volume) {
    j["volume"] = *m.volume;
  } else {
    j["volume"] = nullptr;
  }
  j["edge_length"] = {{"shortest", m.shortest_edge}, {"mean", m.mean_edge}, {"longest", m.longest_edge}};
  j["total_gaussian_curvature"] = m.total_gaussian_curvature;
  j["mean_absolute_mean_curvature"] = m.mean_absolute_mean_curvature;
  j["parts"] = nlohmann::ordered_json::array();
  for (const MeshPart& p : m.parts) {
    j["parts"].push_back({{"triangles", p.triangles},
                          {"area", p.area},
                          {"closed", p.closed},
                          {"volume", p.volume},
                          {"low", p.low},
                          {"high", p.high}});
  }
  return j;
}

void add_measure(CLI::App& app) {
  auto* tool = app.add_subcommand("measure", "Measure a mesh: area, volume, edges, curvature, parts");
  auto o = std::make_shared<MeasureOptions>();
  tool->add_option_function<std::string>(
          "MESH", [o](const std::string& name) { o->mesh = pipe_name(name); },
          "Mesh: .ply .obj .off .stl .glb, each also as .gz; - for PLY on standard input")
      ->required()
      ->type_name("");
  tool->add_flag("--json", o->json, "Print JSON");
  add_run_options(*tool, o->run);
  add_notes(
      *tool,
      "Tells area, volume (where the mesh is closed), edge lengths, boundary, curvature, and each connected part. The "
      "mesh is held in memory.");
  add_examples(*tool, "  lamina measure mesh.ply\n  lamina measure mesh.ply --json");
  tool->callback([o] { run_measure(*o); });
}

}  // namespace lamina::tools

// lamina compare: two-sided distance between a mesh and the truth.
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

struct CompareOptions {
  std::string a, b;
  CompareSettings settings;
  RunContext run;
  bool json = false;
};

nlohmann::ordered_json as_json(const std::optional<DistanceStats>& s, double diagonal) {
  if (!s) return nullptr;
  nlohmann::ordered_json j{
      {"samples", s->samples}, {"rms", s->rms}, {"mean", s->mean}, {"p99", s->p99}, {"max", s->max}};
  if (diagonal > 0)
    j["relative"] = {{"rms", s->rms / diagonal},
                     {"mean", s->mean / diagonal},
                     {"p99", s->p99 / diagonal},
                     {"max", s->max / diagonal}};
  return j;
}

void print_row(const char* label, const DistanceStats& s, double scale) {
  fmt::print("{:<18} {:>12.6g} {:>12.6g} {:>12.6g} {:>12.6g}\n", label, s.rms * scale, s.mean * scale, s.p99 * scale,
             s.max * scale);
}

void print_table(const CompareResult& r) {
  fmt::print("{:<18} {:>12} {:>12} {:>12} {:>12}\n", "distance", "rms", "mean", "p99", "max");
  if (r.a_to_b) print_row("A to B", *r.a_to_b, 1);
  if (r.b_to_a) print_row("B to A", *r.b_to_a, 1);
  if (!(r.diagonal > 0)) return;
  if (r.a_to_b) print_row("A to B / diagonal", *r.a_to_b, 1 / r.diagonal);
  if (r.b_to_a) print_row("B to A / diagonal", *r.b_to_a, 1 / r.diagonal);
  fmt::print("diagonal of B      {:>12.6g}\n", r.diagonal);
}

void run_compare(const CompareOptions& o) {
  if (o.a == "-" && o.b == "-")
    throw Error(ExitCode::usage, "A and B both name standard input; give one of them a file");
  const TriangleMesh a = read_mesh_input(o.a, o.run), b = read_mesh_input(o.b, o.run);
  const CompareResult r = compare(a, b, o.settings, o.run);
  if (!o.json) {
    print_table(r);
    return;
  }
  nlohmann::ordered_json j{{"a", o.a}, {"b", o.b}, {"seed", o.settings.seed}, {"vertices", o.settings.vertices}};
  j.update(compare_json(r));
  fmt::print("{}\n", j.dump(2));
}

}  // namespace

nlohmann::ordered_json compare_json(const CompareResult& r) {
  return {
      {"diagonal", r.diagonal}, {"a_to_b", as_json(r.a_to_b, r.diagonal)}, {"b_to_a", as_json(r.b_to_a, r.diagonal)}};
}

void add_compare_options(CLI::App& tool, CompareSettings& settings) {
  tool.add_option("--count", settings.count, "Samples per side, spread by area")->type_name("N")->capture_default_str();
  tool.add_flag("--vertices", settings.vertices,
                "Measure at the vertices instead of at samples: the part of the error that is their own");
  tool.add_option("--seed", settings.seed, "Another seed, other samples")->type_name("N")->capture_default_str();
}

void add_compare(CLI::App& app) {
  auto* tool = app.add_subcommand("compare", "Measure the two-sided distance between mesh A and mesh B, the truth");
  auto o = std::make_shared<CompareOptions>();
  tool->add_option("A", o->a, "Mesh (or points) to judge")->required()->type_name("");
  tool->add_option("B", o->b, "The truth: mesh (or points); relative figures divide by its box's diagonal")
      ->required()
      ->type_name("");
  add_compare_options(*tool, o->settings);
  tool->add_option("--threads", o->run.threads, "Number of threads; 0 is every core")
      ->type_name("N")
      ->capture_default_str()
      ->group("Run");
  tool->add_flag("--json", o->json, "Print JSON");
  add_notes(
      *tool,
      "Both meshes are held in memory. Distances are in the meshes' units: root mean square, mean, 99th percentile and "
      "maximum of samples of A to the surface of B, and of B to that of A.");
  add_examples(*tool, "  lamina compare mesh.ply other.obj --count 2000");
  tool->callback([o] { run_compare(*o); });
}

}  // namespace lamina::tools

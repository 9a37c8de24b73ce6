// The stages around projection: refinement before, extraction, clustering and writing after.
#include "bench/benches.h"
#include "bench/measure.h"
#include "bench/replay.h"

namespace lamina::bench {
namespace {

using Stage = Replay::Stage;

std::unique_ptr<Replay> before(const Scene& scene, Stage stage, const ProjectSettings& settings = {}) {
  auto replay = std::make_unique<Replay>(scene, settings);
  replay->run_before(stage);
  return replay;
}

void add_stage(const Scene& scene, const std::string& name, Stage stage, const ProjectSettings& settings = {}) {
  add(name, [&scene, stage, settings](benchmark::State& s) {
    measure(
        s, scene.samples(), [&] { return before(scene, stage, settings); },
        [&](const std::unique_ptr<Replay>& replay) { replay->run(stage); });
  });
}

void cluster(benchmark::State& state, const Scene& scene, ClusterMode mode) {
  measure(
      state, scene.samples(), [&] { return before(scene, Stage::cluster); },
      [&](const std::unique_ptr<Replay>& replay) { replay->cluster(mode); });
}

void write_mesh(benchmark::State& state, const Scene& scene) {
  std::uint64_t triangles = 0;
  const auto clustered = [&] {
    auto replay = before(scene, Stage::cluster);
    replay->run(Stage::cluster);
    return replay;
  };
  measure(state, scene.samples(), clustered,
          [&](const std::unique_ptr<Replay>& replay) { triangles = replay->write(); });
  state.counters["triangles_per_sample"] = static_cast<double>(triangles) / static_cast<double>(scene.samples());
}

}  // namespace

void add_stage_benches(const Scene& scene, const std::string& suffix) {
  if (scene.attributes() == 0) {  // these do not see attributes
    add_stage(scene, "mark", Stage::mark);
    add_stage(scene, "refine", Stage::refine);
    add_stage(scene, "place", Stage::place);
    add_stage(scene, "extend", Stage::extend);
    add_stage(scene, "triangulate", Stage::triangulate);
    add("cluster/none", [&scene](benchmark::State& s) { cluster(s, scene, ClusterMode::none); });
    add("cluster/free", [&scene](benchmark::State& s) { cluster(s, scene, ClusterMode::free); });
    add("cluster/preserving", [&scene](benchmark::State& s) { cluster(s, scene, ClusterMode::preserving); });
  }
  ProjectSettings centres;
  centres.centres = true;
  add_stage(scene, "diffuse" + suffix, Stage::diffuse, centres);
  add_stage(scene, "number_edges" + suffix, Stage::number);
  add("write_mesh" + suffix, [&scene](benchmark::State& s) { write_mesh(s, scene); });
}

}  // namespace lamina::bench

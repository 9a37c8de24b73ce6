// Projection: its kernels alone, the finding of samples, and the whole stage.
#include <fmt/format.h>

#include <memory>
#include <random>

#include "bench/benches.h"
#include "bench/measure.h"
#include "bench/replay.h"
#include "mls/row_samples.h"

namespace lamina::bench {
namespace {

using Stage = Replay::Stage;

TileSamples random_samples(std::size_t n, std::size_t attributes) {
  std::mt19937 rng(1);
  std::uniform_real_distribution<float> unit(0, 1);
  TileSamples s;
  s.resize(n, attributes);
  for (std::size_t i = 0; i < n; ++i) {
    const float x = 8 * unit(rng), y = 2 * unit(rng), z = 2 * unit(rng);
    s.put(i, {x, y, z, 1 / (1.5F * 1.5F), 0.6F, 0.0F, 0.8F, 1, 1.5F, 1 / (1.75F * 1.75F)});
    for (auto& a : s.attributes) a[i] = unit(rng);
  }
  return s;
}

Queries row_of_corners() {
  Queries q{};
  for (int l = 0; l < kLanes; ++l) {
    q.x[l] = static_cast<float>(l);
    q.y[l] = q.z[l] = 1;
  }
  return q;
}

/// Items: pairs of a sample and a corner.
void accumulate(benchmark::State& state, const Kernel& kernel, std::size_t attributes) {
  constexpr std::uint32_t kCount = 512;
  const TileSamples samples = random_samples(kCount, attributes);
  const SampleRange range{0, kCount};
  std::vector<Lanes> sums(kSums + attributes, Lanes{});
  const Queries queries = row_of_corners();
  for ([[maybe_unused]] auto iteration : state) {
    kernel.accumulate(samples, &range, 1, queries, sums.data());
    benchmark::DoNotOptimize(sums.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations()) * kCount * kLanes);
}

/// Items: corners.
void fit(benchmark::State& state, const Kernel& kernel, bool sphere) {
  const TileSamples samples = random_samples(64, 0);
  const SampleRange range{0, 64};
  std::vector<Lanes> sums(kSums, Lanes{});
  kernel.accumulate(samples, &range, 1, row_of_corners(), sums.data());
  FitInput in{};
  in.sphere = sphere;
  FitOutput out{};
  for ([[maybe_unused]] auto iteration : state) {
    kernel.fit(sums.data(), in, out);
    benchmark::DoNotOptimize(&out);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations()) * kLanes);
}

/// Items: corners.
void extend(benchmark::State& state, const Kernel& kernel) {
  const auto field = std::make_unique<CornerField>();
  field->distance.fill(0.25F);
  field->nx.fill(0);
  field->ny.fill(0.6F);
  field->nz.fill(0.8F);
  field->trusted.fill(1);
  field->any.fill(1);
  for ([[maybe_unused]] auto iteration : state) {
    const Extension out = kernel.extend(*field, 3, 4, 1.0F, 0.09F);
    benchmark::DoNotOptimize(&out);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations()) * kLanes);
}

std::unique_ptr<Replay> placed(const Scene& scene, const ProjectSettings& settings, const Kernel& kernel) {
  auto replay = std::make_unique<Replay>(scene, settings, kernel);
  replay->run_before(Stage::project);
  return replay;
}

/// Finds the samples of all tiles; with `gather` also fetches them into rows, as the kernel reads them.
void find_samples(benchmark::State& state, const Scene& scene, bool gather) {
  std::uint64_t found = 0;
  RowSamples rows;
  const auto all_slabs = [&](const std::unique_ptr<Replay>& replay) {
    Window& window = replay->window();
    const Lattice& lattice = window.lattice();
    found = 0;
    for (std::int32_t slab = replay->first(); slab <= replay->last(); ++slab) {
      const std::int64_t height = lattice.slab_height();
      for (const auto& numbers : replay->feed().batches(slab * height, (slab + 1) * height, 0)) {
        ClusteredBatch batch;
        for (const auto& bucket : replay->feed().load(numbers)) {
          batch.push_back(std::make_shared<const ClusteredBucket>(cluster_samples(*bucket, lattice)));
        }
        for (int level = 0; level < window.levels(); ++level) {
          const Tiles tiles = window.tiles(level, slab);
          std::vector<Block> blocks;
          for (const Tile& t : tiles) blocks.push_back(t.block);
          const std::int32_t first = lattice.first_layer(level, slab);
          const QueryLayers layers{level, first, first + lattice.layers(level), 0, 0};
          const TileRuns bins = bin_clusters(lattice, layers, batch, blocks);
          for (std::size_t t = 0; t < tiles.size(); ++t) {
            if (gather) rows.gather(lattice, layers, tiles[t].block, bins.of(t));
            found += gather ? rows.size() : bins.of(t).size();
          }
        }
      }
    }
  };
  measure(
      state, scene.samples(), [&] { return placed(scene, {}, select_kernel()); }, all_slabs);
  state.counters["entries_per_sample"] = static_cast<double>(found) / static_cast<double>(scene.samples());
}

void project(benchmark::State& state, const Scene& scene, const ProjectSettings& settings, const Kernel& kernel) {
  double corners = 0;
  double bytes = 0;
  measure(
      state, scene.samples(), [&] { return placed(scene, settings, kernel); },
      [&](const std::unique_ptr<Replay>& replay) {
        replay->run(Stage::project);
        corners = static_cast<double>(replay->projected().corners);
        bytes = static_cast<double>(replay->window().memory());
      });
  state.counters["corners_per_sample"] = corners / static_cast<double>(scene.samples());
  state.counters["window_bytes_per_corner"] = bytes / corners;
}

}  // namespace

void add_kernel_benches() {
  for (const Kernel& kernel : available_kernels()) {
    const std::string name = std::string("/") + kernel.name;
    const auto plain = [&](const std::string& of, auto body) {
      benchmark::RegisterBenchmark(("kernel_" + of + name).c_str(), body);
    };
    plain("accumulate", [kernel](benchmark::State& s) { accumulate(s, kernel, 0); });
    plain("accumulate_colour", [kernel](benchmark::State& s) { accumulate(s, kernel, 3); });
    plain("fit_sphere", [kernel](benchmark::State& s) { fit(s, kernel, true); });
    plain("fit_plane", [kernel](benchmark::State& s) { fit(s, kernel, false); });
    plain("extend", [kernel](benchmark::State& s) { extend(s, kernel); });
  }
}

void add_project_benches(const Scene& scene, const std::string& suffix) {
  const auto add_project = [&](const std::string& name, const ProjectSettings& settings, const Kernel& kernel) {
    add(name + suffix, [&scene, settings, kernel](benchmark::State& s) { project(s, scene, settings, kernel); });
  };
  for (const Kernel& kernel : available_kernels()) add_project(fmt::format("project/{}", kernel.name), {}, kernel);
  if (scene.attributes() > 0) return;
  add("bin", [&scene](benchmark::State& s) { find_samples(s, scene, false); });
  add("bin_and_gather", [&scene](benchmark::State& s) { find_samples(s, scene, true); });
  for (const Fit fit : {Fit::sphere, Fit::plane}) {
    for (const int steps : {1, 2, 4}) {
      ProjectSettings settings;
      settings.fit = fit;
      settings.steps = steps;
      add_project(fmt::format("project/{}/steps:{}", fit == Fit::sphere ? "sphere" : "plane", steps), settings,
                  select_kernel());
    }
  }
  ProjectSettings centres;
  centres.centres = true;
  add_project("project/centres", centres, select_kernel());
}

}  // namespace lamina::bench

// Finding normals: the tree of a window, neighbours one by one and in turn, directions, patches of one sign.
#include <algorithm>
#include <array>
#include <numeric>
#include <optional>

#include "bench/benches.h"
#include "bench/measure.h"
#include "normals/directions.h"
#include "normals/sample_window.h"
#include "samples/nearest_search.h"
#include "samples/sample_tree.h"
#include "samples/sampling_survey.h"

namespace lamina::bench {
namespace {

using normals::Links;
using normals::WindowSamples;

constexpr std::size_t kNeighbours = 16;

/// The whole cloud in one window, normals not yet known.
struct Window {
  explicit Window(const Scene& scene) {
    const SlabStore& store = scene.cloud->ingested.store;
    WindowSamples all;
    LocalSamples local;
    for (std::size_t b = 0; b < store.buckets(); ++b) {
      store.read(b, local);
      all.x.insert(all.x.end(), local.x.begin(), local.x.end());
      all.y.insert(all.y.end(), local.y.begin(), local.y.end());
      all.z.insert(all.z.end(), local.z.begin(), local.z.end());
    }
    const std::size_t n = all.size();
    for (auto* column : {&all.nx, &all.ny, &all.nz, &all.lift}) column->assign(n, 0.0F);
    all.row.resize(n);
    std::iota(all.row.begin(), all.row.end(), std::uint64_t{0});
    all.node.assign(n, normals::kNoNode);
    all.given.assign(n, 0);
    tree.emplace(all.x, all.y, all.z);
    samples.gather(all, tree->order());
    links.core.resize(n);
    std::iota(links.core.begin(), links.core.end(), 0U);
    // A density radius is about twice the spacing; neighbours are looked for within five.
    constexpr float kSearched = 5;
    settings.search_radius = kSearched * survey_radii(store, scene.samples()).high;
  }
  void find_directions() { normals::find_directions(*tree, settings, samples, links); }

  std::optional<SampleTree> tree;
  WindowSamples samples;
  Links links;
  normals::DirectionSettings settings;
};

/// `find` is asked for the neighbours of every place in turn.
template <class Find>
void find_all(const Window& window, Find&& find) {
  std::array<Neighbour, kNeighbours> found;
  const float bound = window.settings.search_radius * window.settings.search_radius;
  for (std::uint32_t place = 0; place < window.samples.size(); ++place)
    benchmark::DoNotOptimize(find.nearest(place, kNeighbours, bound, found.data()));
}

void find_all_in_turn(Window& window) {
  std::array<std::array<Neighbour, SampleTree::kMostNeighbours>, NearestSearch::kAtOnce> found;
  const float bound = window.settings.search_radius * window.settings.search_radius;
  NearestSearch search(*window.tree);
  std::vector<std::uint32_t> places(window.samples.size());
  std::iota(places.begin(), places.end(), 0U);
  for (std::size_t i = 0; i < places.size(); i += found.size()) {
    const std::size_t n = std::min(found.size(), places.size() - i);
    search.start(std::span(places).subspan(i, n), kNeighbours, bound);
    for (std::size_t k = 0; k < n; ++k) benchmark::DoNotOptimize(search.finish(k, found[k].data()));
  }
}

void grow(Window& window) {
  normals::PatchGraph graph;
  normals::PatchSettings patches;
  constexpr float kSide = 8;  // density radii: some hundred samples a patch
  patches.cell =
      std::max(normals::kLeastPatchCell, static_cast<std::int32_t>(kSide / 5 * window.settings.search_radius));
  const normals::Viewpoints none({}, {}, Frame{});
  normals::grow_patches(*window.tree, patches, none, window.links, window.samples, graph);
}

}  // namespace

void add_normal_benches(const Scene& scene) {
  const auto bench = [&scene](const std::string& name, auto prepare, auto work) {
    add("normals/" + name,
        [&scene, prepare, work](benchmark::State& s) { measure(s, scene.samples(), prepare, work); });
  };
  const auto window = [&scene] { return std::make_unique<Window>(scene); };
  const auto with_directions = [&scene] {
    auto w = std::make_unique<Window>(scene);
    w->find_directions();
    return w;
  };
  bench("tree", window, [](const std::unique_ptr<Window>& w) {
    const SampleTree tree(w->samples.x, w->samples.y, w->samples.z);
    benchmark::DoNotOptimize(tree.size());
  });
  bench("nearest/one_by_one", window, [](const std::unique_ptr<Window>& w) { find_all(*w, *w->tree); });
  bench("nearest/in_turn", window, [](const std::unique_ptr<Window>& w) { find_all_in_turn(*w); });
  bench("directions", window, [](const std::unique_ptr<Window>& w) { w->find_directions(); });
  bench("patches", with_directions, [](const std::unique_ptr<Window>& w) { grow(*w); });
}

}  // namespace lamina::bench

#include "mls/project.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "mls/queries.h"
#include "mls/tile_samples.h"
#include "mls/tile_values.h"
#include "octree/refine.h"

namespace lamina {
struct Projector::Scratch {
  struct Local {
    RowSamples rows;
    std::vector<Query> queries;
    TileState state;
    TileFit fit;
  };
  tbb::enumerable_thread_specific<Local> local;
  std::map<std::size_t, std::shared_ptr<const ClusteredBucket>> clustered;  ///< by number of the bucket

  /// The buckets of a batch in clusters; kept for the next levels, steps and slabs while they are few.
  ClusteredBatch load(const std::vector<std::size_t>& batch, SampleFeed& feed, const Lattice& lattice);
};

ClusteredBatch Projector::Scratch::load(const std::vector<std::size_t>& batch, SampleFeed& feed,
                                        const Lattice& lattice) {
  constexpr std::size_t kKeep = std::size_t{1} << 19;  // samples
  ClusteredBatch out(batch.size());
  std::vector<std::size_t> missing;
  std::size_t kept = 0;
  for (const auto& [number, bucket] : clustered) kept += bucket->x.size();
  for (std::size_t b = 0; b < batch.size(); ++b) {
    const auto known = clustered.find(batch[b]);
    if (known == clustered.end()) {
      missing.push_back(b);
    } else {
      out[b] = known->second;
    }
  }
  std::vector<std::size_t> numbers;
  numbers.reserve(missing.size());
  for (const std::size_t b : missing) numbers.push_back(batch[b]);
  const Batch loaded = feed.load(numbers);
  tbb::parallel_for(std::size_t{0}, missing.size(), [&](std::size_t m) {
    out[missing[m]] = std::make_shared<const ClusteredBucket>(cluster_samples(*loaded[m], lattice));
  });
  for (const std::size_t b : missing) {
    kept += out[b]->x.size();
    if (kept <= kKeep) clustered.emplace(batch[b], out[b]);
  }
  return out;
}

namespace {

/// Tiles of a level with points to project in a slab.
std::vector<Work> list_work(Window& window, int level, std::int32_t slab, bool centres) {
  std::vector<Work> work;
  for (const Tile& t : window.tiles(level, slab)) {
    const std::int32_t first = window.lattice().first_layer(level, slab) - t.block.z * 8;
    Work w{t, t.leaf, std::max(first, 0), std::min(8, first + window.lattice().layers(level))};
    if (centres) {
      std::uint64_t any = 0;
      std::array<std::uint64_t, 8> close{};
      close_cells(*t.leaf, w.begin, w.end, &close[w.begin]);
      for (int z = w.begin; z < w.end; ++z) any |= t.leaf->cells.words[z] & close[z];
      if (any == 0) continue;
      if (t.leaf->centres == nullptr) t.leaf->centres = std::make_shared<Projected>();
      w.points = t.leaf->centres.get();
      for (int z = w.begin; z < w.end; ++z) w.points->active.words[z] = t.leaf->cells.words[z] & close[z];
    }
    std::uint64_t active = 0;
    for (int z = w.begin; z < w.end; ++z) active |= w.points->active.words[z];
    if (active != 0) work.push_back(w);
  }
  return work;
}

}  // namespace

Projector::Projector(const ProjectSettings& settings, const Kernel& kernel)
    : settings_(settings), kernel_(kernel), scratch_(std::make_unique<Scratch>()) {}

Projector::~Projector() = default;

float Projector::margin(const Lattice& lattice) const {
  return settings_.steps > 1 ? kStepLimit * static_cast<float>(lattice.cell_size(lattice.levels - 1)) : 0.0F;
}

void Projector::project(Window& window, std::int32_t slab, SampleFeed& feed) {
  const Lattice& lattice = window.lattice();
  const std::int64_t height = lattice.slab_height();
  const std::size_t channels = kSums + static_cast<std::size_t>(window.attributes());
  const auto batches = feed.batches(slab * height, (slab + 1) * height, margin(lattice));
  std::atomic<std::uint64_t> corners = 0;
  std::atomic<std::uint64_t> seen = 0;
  std::atomic<std::uint64_t> trusted = 0;
  std::atomic<std::uint64_t> torn = 0;
  std::atomic<std::uint64_t> sums = 0;
  // The sweep goes up: what no batch of this slab wants, none of the next ones will.
  std::size_t lowest = std::numeric_limits<std::size_t>::max();
  for (const auto& batch : batches) lowest = std::min(lowest, batch.front());
  scratch_->clustered.erase(scratch_->clustered.begin(), scratch_->clustered.lower_bound(lowest));
  for (int level = 0; level < window.levels(); ++level) {
    const std::vector<Work> work = list_work(window, level, slab, settings_.centres);
    if (work.empty()) continue;
    if (batches.empty()) {
      // Nothing is seen here.
      for (const Work& w : work) std::fill_n(&w.points->active.words[w.begin], w.end - w.begin, 0);
      continue;
    }
    std::vector<Block> blocks;
    blocks.reserve(work.size());
    for (const Work& w : work) blocks.push_back(w.tile.block);
    const std::int32_t first = lattice.first_layer(level, slab);
    const std::int32_t end = first + lattice.layers(level);
    const float level_margin = settings_.steps > 1 ? kStepLimit * static_cast<float>(lattice.cell_size(level)) : 0.0F;
    const auto finish = [&](std::size_t t, Scratch::Local& local, TileState& state) {
      settle(kernel_, settings_, state, local.queries, channels);
      const FitCounts counts = fit_tile(kernel_, settings_, channels, state, local.queries, local.fit);
      store_values(window, level, work[t], local.queries, state, local.fit);
      seen.fetch_add(counts.seen, std::memory_order_relaxed);
      trusted.fetch_add(counts.trusted, std::memory_order_relaxed);
      sums.fetch_add(state.sums, std::memory_order_relaxed);
      torn.fetch_add(counts.torn, std::memory_order_relaxed);
      corners.fetch_add(local.queries.size(), std::memory_order_relaxed);
    };
    const int passes = passes_of(settings_);
    if (batches.size() == 1) {
      const ClusteredBatch batch = scratch_->load(batches[0], feed, lattice);
      const QueryLayers layers{level, first, end, level_margin, shift_of(settings_)};
      const TileRuns bins = bin_clusters(lattice, layers, batch, blocks);
      tbb::parallel_for(std::size_t{0}, work.size(), [&](std::size_t t) {
        Scratch::Local& local = scratch_->local.local();
        TileState& state = local.state;
        list_queries(work[t], local.queries);
        start(state, local.queries, channels, shift_of(settings_));
        local.rows.gather(lattice, layers, work[t].tile.block, bins.of(t), settings_.band);
        accumulate(kernel_, local.rows, state, channels);
        for (int pass = 1; pass < passes; ++pass) {
          if (!advance(kernel_, settings_, state, local.queries, channels, pass)) break;
          accumulate(kernel_, local.rows, state, channels);
        }
        finish(t, local, state);
      });
      continue;
    }
    // Sums survive from batch to batch and query points from pass to pass. Later passes are for few tiles.
    std::vector<TileState> kept(work.size());
    std::vector<std::uint32_t> active(work.size());
    std::iota(active.begin(), active.end(), 0U);
    for (int pass = 0; pass < passes; ++pass) {
      std::vector<std::uint8_t> on(active.size());
      tbb::parallel_for(std::size_t{0}, active.size(), [&](std::size_t a) {
        Scratch::Local& local = scratch_->local.local();
        TileState& state = kept[active[a]];
        list_queries(work[active[a]], local.queries);
        if (pass == 0) start(state, local.queries, channels, shift_of(settings_));
        on[a] = pass == 0 || advance(kernel_, settings_, state, local.queries, channels, pass) ? 1 : 0;
      });
      std::vector<std::uint32_t> going;
      blocks.clear();
      for (std::size_t a = 0; a < active.size(); ++a) {
        if (on[a] == 0) continue;
        going.push_back(active[a]);
        blocks.push_back(work[active[a]].tile.block);
      }
      active = std::move(going);
      if (active.empty()) break;
      const QueryLayers layers{level, first, end, pass > 0 ? level_margin : 0.0F, shift_of(settings_)};
      for (const std::vector<std::size_t>& numbers : batches) {
        const ClusteredBatch batch = scratch_->load(numbers, feed, lattice);
        const TileRuns bins = bin_clusters(lattice, layers, batch, blocks);
        tbb::parallel_for(std::size_t{0}, active.size(), [&](std::size_t a) {
          Scratch::Local& local = scratch_->local.local();
          local.rows.gather(lattice, layers, blocks[a], bins.of(a), settings_.band);
          accumulate(kernel_, local.rows, kept[active[a]], channels);
        });
      }
    }
    tbb::parallel_for(std::size_t{0}, work.size(), [&](std::size_t t) {
      Scratch::Local& local = scratch_->local.local();
      list_queries(work[t], local.queries);
      finish(t, local, kept[t]);
    });
  }
  counts_.corners += corners;
  counts_.seen += seen;
  counts_.trusted += trusted;
  counts_.torn += torn;
  counts_.sums += sums;
  constexpr std::uint64_t kEnough = 256;
  const double share = seen < kEnough ? 0.0 : static_cast<double>(torn) / static_cast<double>(seen);
  if (share > counts_.torn_share) {
    counts_.torn_share = share;
    counts_.torn_slab = slab;
  }
}

}  // namespace lamina

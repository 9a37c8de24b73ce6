#include "mls/project.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_group.h>

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "mls/queries.h"
#include "mls/tile_values.h"
#include "octree/refine.h"

namespace lamina {

using NumberedBuckets = std::vector<std::size_t>;

struct Projector::Scratch {
  struct Local {
    RowSamples rows;
    std::vector<Query> queries;
    TileState state;
    TileFit fit;
    CreaseState creases;
    ProjectCounts counts;  ///< of the slab
  };
  tbb::enumerable_thread_specific<Local> local;
  using Clustered = std::map<std::size_t, std::shared_ptr<ClusteredBucket>>;  ///< by number of the bucket
  Clustered clustered;
  Clustered begun;  ///< by tasks
  Batch loaded;     ///< what these are made of, until the tasks are done
  tbb::enumerable_thread_specific<ClusterScratch> clustering;
  tbb::task_group tasks;

  Scratch() = default;
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  ~Scratch() {
    tasks.cancel();
    try {
      tasks.wait();
    } catch (...) {  // the caller has its own reason to leave
    }
  }

  /// Begins to put the buckets of a batch in clusters, those that are not.
  void begin(const NumberedBuckets& batch, SampleFeed& feed, const Lattice& lattice);
  /// The buckets of a batch in clusters; kept for the next levels, steps and slabs while they are few.
  ClusteredBatch load(const NumberedBuckets& batch, SampleFeed& feed, const Lattice& lattice);
  /// The sweep goes up: what no batch of a slab wants, none of the next ones will.
  void forget_below(const std::vector<NumberedBuckets>& batches) {
    std::size_t lowest = std::numeric_limits<std::size_t>::max();
    for (const auto& batch : batches) lowest = std::min(lowest, batch.front());
    clustered.erase(clustered.begin(), clustered.lower_bound(lowest));
  }
};

void Projector::Scratch::begin(const NumberedBuckets& batch, SampleFeed& feed, const Lattice& lattice) {
  NumberedBuckets missing;
  for (const std::size_t number : batch) {
    if (!clustered.contains(number) && !begun.contains(number)) missing.push_back(number);
  }
  for (std::size_t m = 0; const std::shared_ptr<const ActiveBucket>& bucket : feed.load(missing)) {
    const auto out = std::make_shared<ClusteredBucket>();
    begun.emplace(missing[m++], out);
    loaded.push_back(bucket);
    tasks.run([this, lattice, &from = *bucket, &to = *out] { cluster_samples(from, lattice, clustering.local(), to); });
  }
}

ClusteredBatch Projector::Scratch::load(const NumberedBuckets& batch, SampleFeed& feed, const Lattice& lattice) {
  constexpr std::size_t kKeep = std::size_t{1} << 20;  // samples: a batch, or other levels would cluster it anew
  begin(batch, feed, lattice);
  tasks.wait();
  loaded.clear();
  std::size_t kept = 0;
  for (const auto& [number, bucket] : clustered) kept += bucket->samples.size();
  ClusteredBatch out;
  out.reserve(batch.size());
  for (const std::size_t number : batch) {
    if (const auto known = clustered.find(number); known != clustered.end()) {
      out.push_back(known->second);
      continue;
    }
    const std::shared_ptr<ClusteredBucket>& bucket = begun.at(number);
    kept += bucket->samples.size();
    if (kept <= kKeep) {
      clustered.emplace(number, bucket);
      feed.set_aside(number);  // both would be twice the memory
    }
    out.push_back(bucket);
  }
  begun.clear();
  clustering.clear();  // large
  return out;
}

namespace {

/// Tiles of a level with points to project in a slab.
std::vector<Work> list_work(Window& window, int level, std::int32_t slab, bool centres) {
  std::vector<Work> work;
  for (const Tile& t : window.tiles(level, slab)) {
    Work w{t, t.leaf, leaf_layers(window, level, slab, t.block), level};
    const auto [begin, end] = w.layers;
    if (centres) {
      std::uint64_t any = 0;
      std::array<std::uint64_t, 8> close{};
      close_cells(*t.leaf, begin, end, &close[begin]);
      for (int z = begin; z < end; ++z) any |= t.leaf->cells.words[z] & close[z];
      if (any == 0) continue;
      if (t.leaf->centres == nullptr) t.leaf->centres = std::make_shared<Projected>();
      w.points = t.leaf->centres.get();
      for (int z = begin; z < end; ++z) w.points->active.words[z] = t.leaf->cells.words[z] & close[z];
    }
    std::uint64_t active = 0;
    for (int z = begin; z < end; ++z) active |= w.points->active.words[z];
    if (active != 0) work.push_back(w);
  }
  return work;
}

/// Whether the level projects any of a tile's points itself.
bool has_queries(const Work& work) {
  std::uint64_t own = 0;
  for (int z = work.layers.begin; z < work.layers.end; ++z) own |= work.own(z);
  return own != 0;
}

/// Of a group's sums.
std::size_t channels_of(const Window& window, const ProjectSettings& settings) {
  return kSums + static_cast<std::size_t>(window.attributes()) + (settings.residuals ? kResidualSums : 0);
}

std::vector<Block> blocks_of(const std::vector<Work>& work) {
  std::vector<Block> blocks;
  blocks.reserve(work.size());
  for (const Work& w : work) blocks.push_back(w.tile.block);
  return blocks;
}

}  // namespace

/// One level of a slab: its tiles, each of which goes through list, start, the steps and finish.
class Projector::Level {
 public:
  Level(Projector& projector, Window& window, std::int32_t slab, int level, SampleFeed& feed)
      : scratch_(*projector.scratch_),
        rule_{projector.kernel_, projector.settings_, channels_of(window, projector.settings_),
              static_cast<float>(window.lattice().cell_size(level))},
        window_(window),
        lattice_(window.lattice()),
        level_(level),
        feed_(feed) {
    for (const Work& w : list_work(window, level, slab, projector.settings_.centres))
      (has_queries(w) ? work_ : taken_over_).push_back(w);
    layers_.level = level;
    layers_.first = lattice_.first_layer(level, slab);
    layers_.end = layers_.first + lattice_.layers(level);
    layers_.shift = rule_.shift();
  }

  void project(const std::vector<NumberedBuckets>& batches) {
    if (batches.empty()) {
      // Nothing is seen here.
      for (const std::vector<Work>* const some : {&work_, &taken_over_}) {
        for (const Work& w : *some)
          std::fill_n(&w.points->active.words[w.layers.begin], w.layers.end - w.layers.begin, 0);
      }
      return;
    }
    constexpr std::size_t kAtOnce = 16;  // there is little to do for each
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, taken_over_.size(), kAtOnce), [&](const auto& range) {
      for (std::size_t t = range.begin(); t < range.end(); ++t) {
        store_values(rule_, window_, taken_over_[t], {}, {}, {});
      }
    });
    if (work_.empty()) return;
    if (batches.size() == 1) {
      project_at_once(batches.front());
    } else {
      project_in_turns(batches);
    }
  }

 private:
  /// All samples are at hand: a tile does all of its steps before the next one.
  void project_at_once(const NumberedBuckets& numbers) {
    const ClusteredBatch batch = scratch_.load(numbers, feed_, lattice_);
    layers_.margin = margin();
    const TileRuns bins = bin_clusters(lattice_, layers_, batch, blocks_of(work_));
    tbb::parallel_for(
        std::size_t{0}, work_.size(), [&](std::size_t t) { project_tile(work_[t], bins.of(t)); }, window_.affinity());
  }

  void project_tile(const Work& work, std::span<const Run> runs) {
    Scratch::Local& local = scratch_.local.local();
    list_queries(work, local.queries);
    TileSteps steps(rule_, local.queries, local.state);
    steps.start();
    local.rows.gather(lattice_, layers_, work.tile.block, runs);
    steps.accumulate(local.rows);
    for (int pass = 1; pass < rule_.passes() && steps.advance(pass); ++pass) steps.accumulate(local.rows);
    steps.settle();
    if (rule_.settings.creases) {
      CreaseFinder finder(rule_, local.queries, local.state, local.creases);
      for (bool on = finder.start(); on; on = finder.advance()) finder.accumulate(local.rows);
    }
    finish(work, local, local.state, local.creases);
  }

  /// Sums survive from batch to batch and query points from pass to pass. Later passes are for few tiles.
  void project_in_turns(const std::vector<NumberedBuckets>& batches) {
    std::vector<TileState> kept(work_.size());
    std::vector<std::uint32_t> going(work_.size());
    std::iota(going.begin(), going.end(), 0U);
    for (int pass = 0; pass < rule_.passes(); ++pass) {
      going = begin_pass(pass, going, kept);
      if (going.empty()) break;
      layers_.margin = pass > 0 ? margin() : 0.0F;
      for (const NumberedBuckets& numbers : batches) {
        add_batch(numbers, going, [&](std::size_t t, Scratch::Local& local) {
          TileSteps(rule_, local.queries, kept[t]).accumulate(local.rows);
        });
      }
    }
    std::vector<CreaseState> creases(work_.size());
    find_creases_in_turns(batches, kept, creases);
    tbb::parallel_for(std::size_t{0}, work_.size(), [&](std::size_t t) {
      Scratch::Local& local = scratch_.local.local();
      list_queries(work_[t], local.queries);
      finish(work_[t], local, kept[t], creases[t]);
    });
  }

  /// Settles the steps and looks for creases, pass by pass.
  void find_creases_in_turns(const std::vector<NumberedBuckets>& batches, std::vector<TileState>& kept,
                             std::vector<CreaseState>& creases) {
    std::vector<std::uint32_t> going(work_.size());
    std::iota(going.begin(), going.end(), 0U);
    for (bool first = true; !going.empty(); first = false) {
      std::vector<std::uint8_t> on(going.size());
      tbb::parallel_for(std::size_t{0}, going.size(), [&](std::size_t a) {
        const std::uint32_t t = going[a];
        Scratch::Local& local = scratch_.local.local();
        list_queries(work_[t], local.queries);
        if (first) TileSteps(rule_, local.queries, kept[t]).settle();
        CreaseFinder finder(rule_, local.queries, kept[t], creases[t]);
        on[a] = rule_.settings.creases && (first ? finder.start() : finder.advance()) ? 1 : 0;
      });
      going = those(going, on);
      for (const NumberedBuckets& numbers : batches) {
        if (going.empty()) break;
        add_batch(numbers, going, [&](std::size_t t, Scratch::Local& local) {
          list_queries(work_[t], local.queries);
          CreaseFinder(rule_, local.queries, kept[t], creases[t]).accumulate(local.rows);
        });
      }
    }
  }

  static std::vector<std::uint32_t> those(const std::vector<std::uint32_t>& tiles,
                                          const std::vector<std::uint8_t>& on) {
    std::vector<std::uint32_t> out;
    for (std::size_t a = 0; a < tiles.size(); ++a) {
      if (on[a] != 0) out.push_back(tiles[a]);
    }
    return out;
  }

  /// Those of the tiles that go on.
  std::vector<std::uint32_t> begin_pass(int pass, const std::vector<std::uint32_t>& tiles,
                                        std::vector<TileState>& kept) {
    std::vector<std::uint8_t> on(tiles.size());
    tbb::parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t a) {
      Scratch::Local& local = scratch_.local.local();
      list_queries(work_[tiles[a]], local.queries);
      TileSteps steps(rule_, local.queries, kept[tiles[a]]);
      if (pass == 0) steps.start();
      on[a] = pass == 0 || steps.advance(pass) ? 1 : 0;
    });
    return those(tiles, on);
  }

  /// Gathers the samples of a batch for each of the tiles and calls add(tile, local), which finds them in local.rows.
  template <typename Add>
  void add_batch(const NumberedBuckets& numbers, const std::vector<std::uint32_t>& tiles, const Add& add) {
    std::vector<Block> blocks;
    blocks.reserve(tiles.size());
    for (const std::uint32_t t : tiles) blocks.push_back(work_[t].tile.block);
    const ClusteredBatch batch = scratch_.load(numbers, feed_, lattice_);
    const TileRuns bins = bin_clusters(lattice_, layers_, batch, blocks);
    tbb::parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t a) {
      Scratch::Local& local = scratch_.local.local();
      local.rows.gather(lattice_, layers_, blocks[a], bins.of(a));
      add(tiles[a], local);
    });
  }

  /// `local.queries` are the tile's; its steps are settled.
  void finish(const Work& work, Scratch::Local& local, const TileState& state, const CreaseState& creases) {
    fit_tile(rule_, state, local.queries, creases.found, local.fit, local.counts);
    store_values(rule_, window_, work, local.queries, state, local.fit);
  }

  /// How far points may move from where they start, steps.
  [[nodiscard]] float margin() const {
    return rule_.settings.steps > 1 ? kStepLimit * static_cast<float>(lattice_.cell_size(level_)) : 0.0F;
  }

  Scratch& scratch_;
  ProjectRule rule_;
  Window& window_;
  const Lattice& lattice_;
  int level_;
  SampleFeed& feed_;
  std::vector<Work> work_;
  std::vector<Work> taken_over_;  ///< tiles whose points finer levels hold, all of them: no sample is looked at
  QueryLayers layers_;
};

Projector::Projector(const ProjectSettings& settings, const Kernel& kernel)
    : settings_(settings), kernel_(kernel), scratch_(std::make_unique<Scratch>()) {}

Projector::~Projector() = default;

float Projector::margin(const Lattice& lattice) const {
  return settings_.steps > 1 ? kStepLimit * static_cast<float>(lattice.cell_size(lattice.levels - 1)) : 0.0F;
}

std::vector<NumberedBuckets> Projector::batches_of(const Lattice& lattice, std::int32_t slab,
                                                   const SampleFeed& feed) const {
  const std::int64_t height = lattice.slab_height();
  return feed.batches(slab * height, (slab + 1) * height, margin(lattice));
}

void Projector::begin(const Lattice& lattice, std::int32_t slab, SampleFeed& feed) {
  const auto batches = batches_of(lattice, slab, feed);
  scratch_->forget_below(batches);
  if (batches.size() == 1) scratch_->begin(batches.front(), feed, lattice);
}

void Projector::project(Window& window, std::int32_t slab, SampleFeed& feed) {
  const auto batches = batches_of(window.lattice(), slab, feed);
  scratch_->forget_below(batches);
  for (int level = 0; level < window.levels(); ++level) Level(*this, window, slab, level, feed).project(batches);
  add_counts(slab);
}

void Projector::add_counts(std::int32_t slab) {
  std::uint64_t seen = 0;
  std::uint64_t torn = 0;
  for (Scratch::Local& local : scratch_->local) {
    const ProjectCounts of = std::exchange(local.counts, {});
    counts_.corners += of.corners;
    counts_.seen += of.seen;
    counts_.trusted += of.trusted;
    counts_.sums += of.sums;
    counts_.torn += of.torn;
    seen += of.seen;
    torn += of.torn;
  }
  constexpr std::uint64_t kEnough = 256;  // corners of a slab, for a share that tells
  const double share = seen < kEnough ? 0.0 : static_cast<double>(torn) / static_cast<double>(seen);
  if (share > counts_.torn_share) {
    counts_.torn_share = share;
    counts_.torn_slab = slab;
  }
}

}  // namespace lamina

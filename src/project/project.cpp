#include "project/project.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <map>
#include <utility>

#include "project/shared_corners.h"
#include "project/tile_samples.h"

namespace lamina {
namespace {

/// A corner to project, in the tile's compact order.
struct Query {
  std::uint32_t value;  ///< index in the brick's CornerValues
  std::uint8_t x, y, z;
};

/// What a tile keeps between batches and steps: per query the query point and the running sums, lane groups of eight.
struct TileState {
  std::vector<Queries> points;  ///< query points, cells relative to the tile
  std::vector<Lanes> sums;      ///< per group kSums + attributes lanes
};

struct Work {
  Tile tile;
  Projected* points = nullptr;  ///< the block's corners, or its cell centres
  int begin = 0, end = 0;       ///< leaf layers of the slab
};

}  // namespace

struct Projector::Scratch {
  struct Local {
    RowSamples rows;
    std::vector<Query> queries;
    TileState state;
  };
  tbb::enumerable_thread_specific<Local> local;
  std::map<std::size_t, std::shared_ptr<const ClumpedBucket>> clumped;  ///< by number of the bucket

  /// The buckets of a batch in clumps; kept for the next levels, steps and slabs while they are few.
  ClumpedBatch load(const std::vector<std::size_t>& batch, SampleFeed& feed, const Lattice& lattice);
};

ClumpedBatch Projector::Scratch::load(const std::vector<std::size_t>& batch, SampleFeed& feed, const Lattice& lattice) {
  constexpr std::size_t kKeep = std::size_t{1} << 19;  // samples
  ClumpedBatch out(batch.size());
  std::vector<std::size_t> missing;
  std::size_t kept = 0;
  for (const auto& [number, bucket] : clumped) kept += bucket->x.size();
  for (std::size_t b = 0; b < batch.size(); ++b) {
    const auto known = clumped.find(batch[b]);
    if (known == clumped.end()) {
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
    out[missing[m]] = std::make_shared<const ClumpedBucket>(clump(*loaded[m], lattice));
  });
  for (const std::size_t b : missing) {
    kept += out[b]->x.size();
    if (kept <= kKeep) clumped.emplace(batch[b], out[b]);
  }
  return out;
}

namespace {

void list_queries(const Work& work, std::vector<Query>& out) {
  out.clear();
  std::uint32_t value = 0;
  for (int z = work.begin; z < work.end; ++z) {
    const bool corners = work.points == work.tile.leaf;
    const std::uint64_t shared = corners ? work.tile.leaf->shared.words[z] : 0;
    for (std::uint64_t w = work.points->near.words[z]; w != 0; w &= w - 1, ++value) {
      const int bit = std::countr_zero(w);
      if (((shared >> bit) & 1U) != 0) continue;
      out.push_back({value, static_cast<std::uint8_t>(bit & 7), static_cast<std::uint8_t>(bit >> 3),
                     static_cast<std::uint8_t>(z)});
    }
  }
}

/// Cell centres lie half a cell above their corner.
float shift_of(const ProjectSettings& settings) {
  return settings.centres ? 0.5F : 0.0F;
}

std::size_t groups_of(const std::vector<Query>& queries) {
  return (queries.size() + kLanes - 1) / kLanes;
}

/// Query g * 8 + l; groups are filled up with copies of their last query.
const Query& query_of(const std::vector<Query>& queries, std::size_t group, int lane) {
  return queries[std::min(group * kLanes + static_cast<std::size_t>(lane), queries.size() - 1)];
}

void clear_sums(TileState& state, std::size_t groups, std::size_t channels) {
  state.sums.assign(groups * channels, Lanes{});
  for (std::size_t g = 0; g < groups; ++g) state.sums[g * channels + kNearest].v.fill(1e30F);
}

void start(TileState& state, const std::vector<Query>& queries, std::size_t channels, float shift) {
  const std::size_t groups = groups_of(queries);
  state.points.resize(groups);
  for (std::size_t g = 0; g < groups; ++g) {
    for (int l = 0; l < kLanes; ++l) {
      const Query& q = query_of(queries, g, l);
      state.points[g].x[l] = static_cast<float>(q.x) + shift;
      state.points[g].y[l] = static_cast<float>(q.y) + shift;
      state.points[g].z[l] = static_cast<float>(q.z) + shift;
    }
  }
  clear_sums(state, groups, channels);
}

void accumulate(const Kernel& kernel, const RowSamples& rows, TileState& state, std::size_t channels) {
  std::array<SampleRange, RowSamples::kRows> ranges{};
  for (std::size_t g = 0; g < state.points.size(); ++g) {
    const Queries& q = state.points[g];
    const auto [y_lo, y_hi] = std::minmax_element(q.y.v.begin(), q.y.v.end());
    const auto [z_lo, z_hi] = std::minmax_element(q.z.v.begin(), q.z.v.end());
    const int n = rows.ranges(*y_lo, *y_hi, *z_lo, *z_hi, ranges.data());
    kernel.accumulate(rows.samples(), ranges.data(), n, q, &state.sums[g * channels]);
  }
}

FitInput fit_input(const TileState& state, const std::vector<Query>& queries, std::size_t g, Fit fit, float shift) {
  FitInput in;
  in.sphere = fit == Fit::sphere;
  for (int l = 0; l < kLanes; ++l) {
    const Query& q = query_of(queries, g, l);
    in.offset.x[l] = static_cast<float>(q.x) + shift - state.points[g].x[l];
    in.offset.y[l] = static_cast<float>(q.y) + shift - state.points[g].y[l];
    in.offset.z[l] = static_cast<float>(q.z) + shift - state.points[g].z[l];
  }
  return in;
}

/// Corners farther than this (cells) from their surface gain nothing from further steps.
constexpr float kStepLimit = 1.5F;

/// Moves the query points to the projected points for the next step.
void advance(const Kernel& kernel, const ProjectSettings& settings, TileState& state, const std::vector<Query>& queries,
             std::size_t channels) {
  const float shift = shift_of(settings);
  FitOutput out{};
  for (std::size_t g = 0; g < state.points.size(); ++g) {
    kernel.fit(&state.sums[g * channels], fit_input(state, queries, g, settings.fit, shift), out);
    for (int l = 0; l < kLanes; ++l) {
      const Query& q = query_of(queries, g, l);
      const float d = out.distance[l];
      if (state.sums[g * channels + kW][l] <= 0 || d > kStepLimit || d < -kStepLimit) continue;
      state.points[g].x[l] = static_cast<float>(q.x) + shift - d * out.nx[l];
      state.points[g].y[l] = static_cast<float>(q.y) + shift - d * out.ny[l];
      state.points[g].z[l] = static_cast<float>(q.z) + shift - d * out.nz[l];
    }
  }
  clear_sums(state, state.points.size(), channels);
}

struct Tally {
  std::uint64_t seen = 0, good = 0, torn = 0;
};

/// Whether the normals a corner sees contradict each other.
bool is_torn(const Lanes* sums, int lane) {
  const float x = sums[kNx][lane];
  const float y = sums[kNy][lane];
  const float z = sums[kNz][lane];
  return x * x + y * y + z * z < 0.25F * sums[kW][lane] * sums[kW][lane];
}

/// Whether a sample close enough contributed to a corner.
bool is_seen(const Lanes* sums, int lane) {
  return sums[kW][lane] > 0 && sums[kNearest][lane] <= 1;
}

/// Fits every query of a tile and stores what the later stages need.
Tally store(const Kernel& kernel, const ProjectSettings& settings, const Window& window, int level, const Work& work,
            const TileState& state, const std::vector<Query>& queries) {
  const std::size_t channels = kSums + static_cast<std::size_t>(window.attributes());
  Projected& points = *work.points;
  CornerValues& values = points.values[window.brick_of(level, work.begin)];
  const auto cell = static_cast<float>(window.lattice().cell_size(level));
  Tally tally;
  FitOutput out{};
  for (std::size_t g = 0; g < state.points.size(); ++g) {
    const Lanes* sums = &state.sums[g * channels];
    bool any = false;
    for (int l = 0; l < kLanes; ++l) any = any || is_seen(sums, l);
    if (!any) continue;
    kernel.fit(sums, fit_input(state, queries, g, settings.fit, shift_of(settings)), out);
    for (std::size_t i = g * kLanes; i < std::min(queries.size(), (g + 1) * kLanes); ++i) {
      const int l = static_cast<int>(i - g * kLanes);
      const Query& q = queries[i];
      const int offset = BlockMask::offset(q.x, q.y, q.z);
      const bool has_normal = out.nx[l] != 0 || out.ny[l] != 0 || out.nz[l] != 0;
      if (!is_seen(sums, l) || !has_normal) continue;
      tally.torn += is_torn(sums, l) ? 1 : 0;
      const bool good =
          out.reach[l] <= settings.good_reach && sums[kSeen][l] >= static_cast<float>(settings.good_samples);
      points.seen.set(offset);
      ++tally.seen;
      if (good) {
        points.good.set(offset);
        ++tally.good;
      }
      values.channel(kDistance)[q.value] = out.distance[l] * cell;
      values.channel(kNormalX)[q.value] = out.nx[l];
      values.channel(kNormalY)[q.value] = out.ny[l];
      values.channel(kNormalZ)[q.value] = out.nz[l];
      values.channel(kCurvature)[q.value] = out.curvature[l] / cell;
      values.channel(kReach)[q.value] = out.reach[l];
      const float inv = 1.0F / sums[kW][l];
      for (int c = 0; c < window.attributes(); ++c)
        values.channel(kFirstAttribute + c)[q.value] = sums[kSums + c][l] * inv;
    }
  }
  return tally;
}

/// Tiles of a level with points to project in a slab; allocates their values.
std::vector<Work> list_work(Window& window, int level, std::int32_t slab, bool centres) {
  std::vector<Work> work;
  for (const Tile& t : window.tiles(level, slab)) {
    const std::int32_t first = window.lattice().first_layer(level, slab) - t.block.z * 8;
    Work w{t, t.leaf, std::max(first, 0), std::min(8, first + window.lattice().layers(level))};
    if (centres) {
      std::uint64_t any = 0;
      for (int z = w.begin; z < w.end; ++z) any |= t.leaf->cells.words[z] & t.leaf->close.words[z];
      if (any == 0) continue;
      if (t.leaf->centres == nullptr) t.leaf->centres = std::make_shared<Projected>();
      w.points = t.leaf->centres.get();
      for (int z = w.begin; z < w.end; ++z) w.points->near.words[z] = t.leaf->cells.words[z] & t.leaf->close.words[z];
    }
    if (!allocate_values(window, level, *w.points, w.begin, w.end)) continue;
    work.push_back(w);
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
  std::atomic<std::uint64_t> good = 0;
  std::atomic<std::uint64_t> torn = 0;
  // The sweep goes up: what no batch of this slab wants, none of the next ones will.
  std::size_t lowest = std::numeric_limits<std::size_t>::max();
  for (const auto& batch : batches) lowest = std::min(lowest, batch.front());
  scratch_->clumped.erase(scratch_->clumped.begin(), scratch_->clumped.lower_bound(lowest));
  for (int level = 0; level < window.levels(); ++level) {
    const std::vector<Work> work = list_work(window, level, slab, settings_.centres);
    if (work.empty()) continue;
    std::vector<Block> blocks;
    blocks.reserve(work.size());
    for (const Work& w : work) blocks.push_back(w.tile.block);
    const std::int32_t first = lattice.first_layer(level, slab);
    const std::int32_t end = first + lattice.layers(level);
    const float level_margin = settings_.steps > 1 ? kStepLimit * static_cast<float>(lattice.cell_size(level)) : 0.0F;
    // Sums survive from batch to batch and query points from step to step; one batch keeps both in the thread's
    // scratch.
    std::vector<TileState> kept(batches.size() > 1 ? work.size() : 0);
    for (int step = 0; step < settings_.steps; ++step) {
      if (batches.size() == 1 && step > 0) break;
      const float halo = batches.size() == 1 || step > 0 ? level_margin : 0.0F;
      for (std::size_t b = 0; b < batches.size(); ++b) {
        const ClumpedBatch batch = scratch_->load(batches[b], feed, lattice);
        const Reach reach{level, first, end, halo, shift_of(settings_)};
        const TileRuns bins = bin_clumps(lattice, reach, batch, blocks);
        tbb::parallel_for(std::size_t{0}, work.size(), [&](std::size_t t) {
          Scratch::Local& local = scratch_->local.local();
          list_queries(work[t], local.queries);
          if (local.queries.empty()) return;
          TileState& state = kept.empty() ? local.state : kept[t];
          if (b == 0) {
            if (step == 0) {
              start(state, local.queries, channels, shift_of(settings_));
            } else {
              advance(kernel_, settings_, state, local.queries, channels);
            }
          }
          local.rows.gather(lattice, reach, work[t].tile.block, bins.of(t), settings_.band);
          accumulate(kernel_, local.rows, state, channels);
          if (b + 1 < batches.size()) return;
          if (batches.size() == 1) {
            for (int more = 1; more < settings_.steps; ++more) {
              advance(kernel_, settings_, state, local.queries, channels);
              accumulate(kernel_, local.rows, state, channels);
            }
          } else if (step + 1 < settings_.steps) {
            return;
          }
          const Tally tally = store(kernel_, settings_, window, level, work[t], state, local.queries);
          seen.fetch_add(tally.seen, std::memory_order_relaxed);
          good.fetch_add(tally.good, std::memory_order_relaxed);
          torn.fetch_add(tally.torn, std::memory_order_relaxed);
          corners.fetch_add(local.queries.size(), std::memory_order_relaxed);
        });
      }
    }
    if (level > 0 && !settings_.centres) {
      tbb::parallel_for(std::size_t{0}, work.size(),
                        [&](std::size_t t) { copy_shared(window, level, work[t].tile, work[t].begin, work[t].end); });
    }
  }
  counts_.corners += corners;
  counts_.seen += seen;
  counts_.good += good;
  counts_.torn += torn;
  constexpr std::uint64_t kEnough = 256;
  const double share = seen < kEnough ? 0.0 : static_cast<double>(torn) / static_cast<double>(seen);
  if (share > counts_.torn_share) {
    counts_.torn_share = share;
    counts_.torn_slab = slab;
  }
}

}  // namespace lamina

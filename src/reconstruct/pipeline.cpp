#include "reconstruct/pipeline.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/vectors.h"
#include "lamina/error.h"
#include "mls/extension.h"
#include "mls/project.h"
#include "octree/refine.h"

namespace lamina {

Pipeline::Pipeline(const ReconstructionPlan& plan, SampleFeed& feed, const SlabSpan& span, const SweepOutput& output)
    : plan_(plan),
      feed_(feed),
      volume_(output.volume),
      kernel_(select_kernel()),
      window_(plan.lattice, static_cast<int>(plan.attributes.size()), plan.extent, plan.projection.rare_channels()),
      projector_(plan.projection, kernel_),
      output_(plan, output.mesh),
      stages_(plan.stages_of(span)),
      sample_reach_(sample_reach(plan)),
      refined_(stages_.of(Stage::refine).begin),
      placed_(stages_.of(Stage::place).begin),
      projected_(stages_.of(Stage::project).begin),
      extended_(stages_.of(Stage::extend).begin),
      numbered_(stages_.of(Stage::number).begin),
      triangulated_(stages_.of(Stage::triangulate).begin),
      held_(stages_.of(Stage::triangulate).begin),
      covered_(stages_.of(Stage::refine).begin),
      leaf_cells_(static_cast<std::size_t>(plan.lattice.levels), 0) {
  if (const auto from = z_read(plan, span).from) feed_.begin_at(*from);
}

void Pipeline::mark(const Batch& buckets) {
  constexpr std::size_t kPiece = 1024;
  for (const auto& bucket : buckets) {
    const auto [low, high] = least_and_greatest(bucket->samples.z);
    for (covered_ = std::min(covered_, plan_.lattice.slab_of(low) - 1); covered_ <= plan_.lattice.slab_of(high) + 2;
         ++covered_) {
      window_.cover(covered_);
    }
  }
  const auto mark_piece = [&](const ActiveBucket& bucket, std::size_t begin) {
    std::array<Mark, kPiece> marks;
    std::size_t count = 0;
    for (std::size_t i = begin; i < std::min(begin + kPiece, bucket.samples.size()); ++i) {
      if (bucket.support[i] <= 0) continue;
      // Corners beyond the band keep no value. Samples mark up to two cells away: what a wider band holds beyond that,
      // others have to mark for them.
      const auto cell = static_cast<float>(plan_.lattice.cell_size(bucket.level[i]));
      const bool narrow = bucket.band[i] < 2 * cell;
      const float reach = narrow ? std::min(bucket.support[i], bucket.band[i]) : bucket.support[i];
      const LocalSamples& s = bucket.samples;
      marks[count++] = {
          s.x[i], s.y[i], s.z[i], bucket.level[i], reach, {s.nx[i], s.ny[i], s.nz[i]}, plan_.projection.height};
    }
    mark_samples(window_, {marks.data(), count});
  };
  tbb::parallel_for(std::size_t{0}, buckets.size(), [&](std::size_t b) {
    const ActiveBucket& bucket = *buckets[b];
    tbb::parallel_for(std::size_t{0}, (bucket.samples.size() + kPiece - 1) / kPiece,
                      [&](std::size_t piece) { mark_piece(bucket, piece * kPiece); });
  });
}

void Pipeline::refine_to(std::int32_t slab) {
  for (; refined_ < std::min(slab + 1, stages_.of(Stage::refine).end); ++refined_) {
    refine_slab(window_, refined_);
    for (int level = 0; level < window_.levels(); ++level) {
      leaf_cells_[static_cast<std::size_t>(level)] += count_cells(window_, level, refined_);
    }
  }
  for (; placed_ < refined_; ++placed_) place_corners(window_, placed_);
}

void Pipeline::project_to(std::int32_t slab) {
  for (; projected_ < std::min(slab + 1, stages_.of(Stage::project).end); ++projected_) {
    projector_.project(window_, projected_, feed_);
    if (plan_.projection.centres) diffuse_slab(window_, projected_);
  }
}

void Pipeline::extend_to(std::int32_t slab) {
  for (; extended_ < std::min(slab + 1, stages_.of(Stage::extend).end); ++extended_) {
    extend_slab(window_, extended_, kernel_, plan_.boundary);
  }
}

void Pipeline::number_to(std::int32_t slab, Stopwatch& watch) {
  for (; numbered_ < std::min(slab + 1, stages_.of(Stage::number).end); ++numbered_) {
    IsoSlab* below = iso_.empty() ? nullptr : iso_.back().get();
    std::shared_ptr<IsoSlab> here = output_.spare();
    const CornerRule rule{plan_.doubtful, static_cast<float>(plan_.trim), plan_.cluster == ClusterMode::none};
    number_edges(window_, numbered_, rule, below, *here);
    isovertices_ += here->vertices.size();
    if (volume_ != nullptr) watch.time("volume", [&] { volume_->add(window_, *here, numbered_); });
    iso_.push_back(std::move(here));
    // Corners of the next slab are extended from this one's values, but no farther back.
    if (numbered_ > plan_.slabs.begin) window_.retire_values(numbered_ - 1);
  }
}

void Pipeline::triangulate_to(std::int32_t slab) {
  IsoSlab nothing;
  for (; triangulated_ < std::min(slab + 1, stages_.of(Stage::triangulate).end); ++triangulated_) {
    const auto at = static_cast<std::size_t>(triangulated_ - held_);
    IsoSlab& here = *iso_[at];
    IsoSlab& above = at + 1 < iso_.size() ? *iso_[at + 1] : nothing;
    here.triangles = output_.spare_triangles();
    triangulate(window_, triangulated_, here, above, extracted_);
    separate_fans(at > 0 ? iso_[at - 1].get() : nullptr, here, &above, extracted_);
    isotriangles_ += here.triangles.size();
    if (at > 0) hand_over();
  }
  // The last one: nothing above it, or nothing that the slabs asked for still depend on.
  if (triangulated_ == stages_.of(Stage::triangulate).end && !iso_.empty()) hand_over();
}

void Pipeline::hand_over() {
  output_.push(std::move(iso_.front()));
  iso_.pop_front();
  ++held_;
}

void Pipeline::retire() {
  window_.retire_below(triangulated_ - 1);
  // The next slab to project is reached from as far below as a sample can act.
  feed_.release(std::int64_t{projected_} * plan_.lattice.slab_height() - static_cast<std::int64_t>(sample_reach_) - 1);
}

std::int64_t Pipeline::samples_for(std::int32_t step) const {
  const std::int64_t projected = std::int64_t{step} + plan_.window + reach_of(Stage::project).ahead;
  return samples_end(plan_.lattice, std::min<std::int64_t>(projected, stages_.of(Stage::project).end), sample_reach_);
}

void Pipeline::run(const RunContext& run, Stopwatch& watch) {
  const auto [first, end] = stages_.of(Stage::triangulate);
  for (std::int32_t step = first; step < end; step += plan_.window) {
    const std::int32_t top = std::min(step + plan_.window, end) - 1;  // slabs to triangulate in this step
    const auto ahead = [&](Stage stage) { return top + reach_of(stage).ahead; };
    watch.time("radii", [&] {
      feed_.prepare(samples_for(step), [&](const Batch& b) { watch.time("mark", [&] { mark(b); }); });
      feed_.look_ahead(samples_for(step + plan_.window), samples_for(step + 2 * plan_.window));
    });
    if (projected_ < stages_.of(Stage::project).end) projector_.begin(plan_.lattice, projected_, feed_);
    watch.time("refine", [&] { refine_to(ahead(Stage::refine)); });
    watch.time("project", [&] { project_to(ahead(Stage::project)); });
    watch.time("extend", [&] { extend_to(ahead(Stage::extend)); });
    watch.time("number", [&] { number_to(ahead(Stage::number), watch); });
    watch.time("triangulate", [&] { triangulate_to(ahead(Stage::triangulate)); });
    watch.time("cluster and write", [&] { output_.start(); });
    note_disk();
    retire();
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    if (run.progress) run.progress({"surface", feed_.released(), plan_.samples, top - first + 1, end - first});
  }
  const bool complete = end == plan_.slabs.end;  // else slabs follow that are not asked for
  watch.time("cluster and write", [&] { complete ? output_.finish() : output_.wait(); });
  note_disk();
}

void Pipeline::note_disk() {
  constexpr std::uint64_t kFaceBytes = 13;  // a count of 1 byte and three indices of 4
  const std::uint64_t mesh = kFaceBytes * output_.triangles() + plan_.waiting_vertex_bytes * output_.vertices();
  disk_bytes_ = std::max(disk_bytes_, feed_.disk_bytes() + mesh);
}

void Pipeline::report(SurfaceStats& stats) const {
  stats.corners = projector_.counts().corners;
  stats.corners_seen = projector_.counts().seen;
  stats.corners_trusted = projector_.counts().trusted;
  stats.corner_sums = projector_.counts().sums;
  stats.corners_torn = projector_.counts().torn;
  stats.torn_slab = projector_.counts().torn_slab - plan_.slabs.begin;
  stats.torn_share = projector_.counts().torn_share;
  stats.isovertices = isovertices_;
  stats.isotriangles = isotriangles_;
  stats.rejected_loops = extracted_.rejected_loops;
  stats.general_cells = extracted_.general_cells;
  stats.crossing_cells = extracted_.crossing_cells;
  stats.leaf_cells = leaf_cells_;
  stats.clusters = output_.counts();
  stats.disk_bytes = disk_bytes_;
}

}  // namespace lamina

#include "reconstruct/pipeline.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "lamina/error.h"
#include "mls/diffuse.h"
#include "mls/finish.h"
#include "octree/refine.h"

namespace lamina {
namespace {

/// Where corners themselves say how many they need.
constexpr int kMostProjections = 16;

ProjectSettings project_settings(const SurfaceSettings& s, const SupportChoice& support) {
  ProjectSettings p;
  p.fit = s.fit == FitMode::sphere ? Fit::sphere : Fit::plane;
  p.steps = s.steps == 0 ? kMostProjections : s.steps;
  if (s.steps == 0) p.tolerance = static_cast<float>(s.step_tolerance / support.blend);
  p.centres = s.diffuse;
  p.band = support.band;
  p.good_reach = support.good_reach;
  p.good_samples = support.good_samples;
  return p;
}

/// Cells follow the radii, so most cells tell the median radius and larger ones as much more. Cells that are smaller
/// for thin things tell nothing.
RadiusRule radius_rule(const Resolved& resolved) {
  const double influence = resolved.support.blend * resolved.plan.radius_median;
  const auto main_cell = static_cast<double>(resolved.lattice.cell_size(resolved.main_level));
  return {influence / main_cell, resolved.support.thin_cells ? influence : 0};
}

}  // namespace

Pipeline::Pipeline(const SurfaceSettings& settings, const Resolved& resolved, const Frame& frame, const Extent& extent,
                   SampleFeed& feed, std::size_t attributes, SlabSink& sink, const SlabSpan& span,
                   SurfaceVolume* volume)
    : settings_(settings),
      resolved_(resolved),
      feed_(feed),
      volume_(volume),
      kernel_(select_kernel()),
      window_(resolved.lattice, static_cast<int>(attributes), extent),
      projector_(project_settings(settings, resolved.support), kernel_),
      output_(ClusterSettings{settings.cluster}, static_cast<float>(settings.chord),
              settings.vertex_levels ? static_cast<double>(resolved.lattice.cell_size(0)) : 0, radius_rule(resolved),
              settings.vertex_curvature, frame, sink),
      all_(all_slabs(resolved.lattice, extent)),
      stages_(stage_spans(span, all_, settings.diffuse)),
      refined_(stages_.refined.begin),
      placed_(stages_.placed.begin),
      projected_(stages_.projected.begin),
      finished_(stages_.finished.begin),
      numbered_(stages_.numbered.begin),
      triangulated_(stages_.triangulated.begin),
      held_(stages_.triangulated.begin),
      covered_(stages_.refined.begin),
      leaf_cells_(static_cast<std::size_t>(resolved.lattice.levels), 0) {
  if (const auto from = z_read(settings, resolved, span, all_).from) feed_.begin_at(*from);
}

ZRead z_read(const SurfaceSettings& settings, const Resolved& resolved, const SlabSpan& span, const SlabSpan& all) {
  const Lattice& lattice = resolved.lattice;
  const std::int64_t height = lattice.slab_height();
  const StageSpans stages = stage_spans(span, all, settings.diffuse);
  const double ahead =
      static_cast<double>(support_limit(resolved.feed, lattice)) +
      static_cast<double>(Projector(project_settings(settings, resolved.support), select_kernel()).margin(lattice));
  ZRead z;
  if (span.begin > all.begin) {
    z.from = std::min(stages.marked.begin * height,
                      stages.projected.begin * height - static_cast<std::int64_t>(std::ceil(ahead)) - 1);
  }
  z.to = std::max((stages.projected.end + kReachSlabs) * height,
                  stages.projected.end * height + static_cast<std::int64_t>(ahead) + 1);
  return z;
}

void Pipeline::mark(const ActiveBucket& bucket) {
  constexpr std::size_t kPiece = 2048;
  // Corners beyond the band keep no value. Samples mark up to two cells away: what a wider band holds beyond that,
  // others have to mark for them.
  const bool narrow = resolved_.support.band < 2;
  const std::size_t n = bucket.samples.size();
  const auto [low, high] = std::minmax_element(bucket.samples.z.begin(), bucket.samples.z.end());
  for (covered_ = std::min(covered_, resolved_.lattice.slab_of(*low) - 1);
       covered_ <= resolved_.lattice.slab_of(*high) + 2; ++covered_) {
    window_.cover(covered_);
  }
  tbb::parallel_for(std::size_t{0}, (n + kPiece - 1) / kPiece, [&](std::size_t piece) {
    std::array<Mark, kPiece> marks;
    std::size_t count = 0;
    for (std::size_t i = piece * kPiece; i < std::min(n, (piece + 1) * kPiece); ++i) {
      if (bucket.support[i] <= 0) continue;
      const auto cell = static_cast<float>(resolved_.lattice.cell_size(bucket.level[i]));
      const float reach = narrow ? std::min(bucket.support[i], resolved_.support.band * cell) : bucket.support[i];
      marks[count++] = {bucket.samples.x[i], bucket.samples.y[i], bucket.samples.z[i], bucket.level[i], reach};
    }
    mark_samples(window_, {marks.data(), count});
  });
}

void Pipeline::refine_to(std::int32_t slab) {
  for (; refined_ < std::min(slab + 1, stages_.refined.end); ++refined_) {
    refine_slab(window_, refined_);
    for (int level = 0; level < window_.levels(); ++level) {
      leaf_cells_[static_cast<std::size_t>(level)] += count_cells(window_, level, refined_);
    }
  }
  for (; placed_ < refined_; ++placed_) place_corners(window_, placed_);
}

void Pipeline::project_to(std::int32_t slab) {
  for (; projected_ < std::min(slab + 1, stages_.projected.end); ++projected_) {
    projector_.project(window_, projected_, feed_);
    if (settings_.diffuse) diffuse_slab(window_, projected_);
  }
}

void Pipeline::finish_to(std::int32_t slab) {
  for (; finished_ < std::min(slab + 1, stages_.finished.end); ++finished_) {
    finish_slab(window_, finished_, kernel_, static_cast<float>(settings_.boundary));
  }
}

void Pipeline::number_to(std::int32_t slab, Stopwatch& watch) {
  for (; numbered_ < std::min(slab + 1, stages_.numbered.end); ++numbered_) {
    IsoSlab* below = iso_.empty() ? nullptr : iso_.back().get();
    std::shared_ptr<IsoSlab> here = output_.spare();
    number_edges(window_, numbered_, below, *here);
    isovertices_ += here->vertices.size();
    if (volume_ != nullptr) watch.time("volume", [&] { volume_->add(window_, *here, numbered_); });
    iso_.push_back(std::move(here));
    // Corners of the next slab are extended from this one's values, but no farther back.
    if (numbered_ > all_.begin) window_.retire_values(numbered_ - 1);
  }
}

void Pipeline::triangulate_to(std::int32_t slab) {
  IsoSlab nothing;
  for (; triangulated_ < std::min(slab + 1, stages_.triangulated.end); ++triangulated_) {
    const auto at = static_cast<std::size_t>(triangulated_ - held_);
    IsoSlab& here = *iso_[at];
    triangulate(window_, triangulated_, here, at + 1 < iso_.size() ? *iso_[at + 1] : nothing, extracted_);
    separate_fans(at > 0 ? iso_[at - 1].get() : nullptr, here, extracted_);
    isotriangles_ += here.triangles.size();
    if (at > 0) hand_over();
  }
  // The last one: nothing above it, or nothing that the slabs asked for still depend on.
  if (triangulated_ == stages_.triangulated.end && !iso_.empty()) hand_over();
}

void Pipeline::hand_over() {
  output_.push(std::move(iso_.front()));
  iso_.pop_front();
  ++held_;
}

void Pipeline::retire() {
  const Lattice& lattice = resolved_.lattice;
  window_.retire_below(triangulated_ - 1);
  // The next slab to project is reached from as far below as a sample can act.
  const double reach = static_cast<double>(feed_.support_limit()) + static_cast<double>(projector_.margin(lattice));
  feed_.release(std::int64_t{projected_} * lattice.slab_height() - static_cast<std::int64_t>(reach) - 1);
}

void Pipeline::run(const RunContext& run, Stopwatch& watch) {
  const Lattice& lattice = resolved_.lattice;
  const std::int64_t height = lattice.slab_height();
  const double ahead = static_cast<double>(feed_.support_limit()) + static_cast<double>(projector_.margin(lattice));
  const auto [first, end] = stages_.triangulated;
  for (std::int32_t step = first; step < end; step += settings_.window) {
    const std::int32_t top = std::min(step + settings_.window, end) - 1;  // slabs to triangulate in this step
    const std::int64_t above = std::min(top + 3, stages_.projected.end - 1) + 1;
    const std::int64_t marked = (above + kReachSlabs) * height;
    const std::int64_t needed = above * height + static_cast<std::int64_t>(ahead) + 1;
    watch.time("radii", [&] {
      feed_.prepare(std::max(marked, needed), [&](const ActiveBucket& b) { watch.time("mark", [&] { mark(b); }); });
    });
    watch.time("refine", [&] { refine_to(top + 3); });
    watch.time("project", [&] { project_to(top + 3); });
    watch.time("finish", [&] { finish_to(top + 2); });
    watch.time("number", [&] { number_to(top + 1, watch); });
    watch.time("triangulate", [&] { triangulate_to(top); });
    watch.time("cluster and write", [&] { output_.start(); });
    note_disk();
    retire();
    if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
    if (run.progress) run.progress({"surface", feed_.released(), resolved_.plan.samples, top - first + 1, end - first});
  }
  const bool complete = end == all_.end;  // else slabs follow that are not asked for
  watch.time("cluster and write", [&] { complete ? output_.finish() : output_.wait(); });
  note_disk();
}

void Pipeline::note_disk() {
  constexpr std::uint64_t kFaceBytes = 13;  // a count of 1 byte and three indices of 4
  disk_bytes_ = std::max(disk_bytes_, feed_.disk_bytes() + kFaceBytes * output_.triangles());
}

void Pipeline::report(SurfaceStats& stats) const {
  stats.corners = projector_.counts().corners;
  stats.corners_seen = projector_.counts().seen;
  stats.corners_good = projector_.counts().good;
  stats.corner_sums = projector_.counts().sums;
  stats.corners_torn = projector_.counts().torn;
  stats.torn_slab = projector_.counts().torn_slab - all_.begin;
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

#include <fmt/format.h>

#include <cmath>

#include "chunks/cuts.h"
#include "chunks/job.h"
#include "chunks/part_slabs.h"
#include "lamina/chunk.h"
#include "lamina/error.h"
#include "reconstruct/choose_support.h"
#include "reconstruct/kept_input.h"

namespace lamina {
namespace {

constexpr int kMostChunks = 100000;

ChunkStats run_chunk(const SurfaceSettings& settings, const Chunk& chunk, const RunContext& run) {
  ChunkStats stats;
  Stopwatch watch;
  const Stopwatch::Moment began = Stopwatch::now();
  SweepInput input = open_kept_input(settings.input, settings);
  const Resolved resolved =
      plan_surface(settings, input, run, watch, Stopwatch::now().wall - began.wall, stats.surface);
  const SlabSpan all = all_slabs(resolved.lattice, input.ingested.extent);
  const SlabSpan span =
      cut(input.ingested.store, resolved.lattice, all, chunk.count)[static_cast<std::size_t>(chunk.number - 1)];
  stats.first_slab = span.begin - all.begin;
  stats.slabs = span.end - span.begin;
  stats.all_slabs = all.end - all.begin;
  const std::uint64_t job = job_hash(settings, kept_input_id(settings.input), resolved);
  PartSlabs parts({{chunk.number, span, settings.output}}, chunk.count, job, hole_settings(settings, resolved.support),
                  mesh_layout(settings, input, resolved));
  if (!span.empty()) {
    const SlabSpan projected = stage_spans(span, all, settings.diffuse).projected;
    stats.overlap_slabs = projected.end - projected.begin - stats.slabs;
    const std::vector<double> samples = slab_samples(input.ingested.store, resolved.lattice, all);
    double sum = 0;
    for (std::int32_t s = span.begin; s < span.end; ++s) sum += samples[static_cast<std::size_t>(s - all.begin)];
    stats.samples = static_cast<std::uint64_t>(std::llround(sum));
    sweep(settings, input, resolved, span, parts, nullptr, run, watch, stats.surface);
  }
  watch.time("commit", [&] { parts.finish(); });
  stats.surface.vertices = parts.vertices();
  stats.surface.triangles = parts.triangles();
  finish_stats(watch, began, stats.surface);
  return stats;
}

}  // namespace

ChunkStats reconstruct_chunk(const SurfaceSettings& settings, const Chunk& chunk, const RunContext& run) {
  check_settings(settings);
  require_mesh_alone(settings, "--chunk");
  if (chunk.count < 1 || chunk.count > kMostChunks || chunk.number < 1 || chunk.number > chunk.count) {
    throw Error(ExitCode::usage, fmt::format("--chunk {}/{}: must be i/n with 1 <= i <= n <= {}", chunk.number,
                                             chunk.count, kMostChunks));
  }
  if (!settings.more_inputs.empty() || !is_kept_input(settings.input)) {
    throw Error(ExitCode::usage, fmt::format("{}: is no store; --chunk works on one that 'lamina sort IN... --store "
                                             "DIR' has made",
                                             settings.input));
  }
  ChunkStats stats;
  run_in_arena(run, [&] { stats = run_chunk(settings, chunk, run); });
  return stats;
}

}  // namespace lamina

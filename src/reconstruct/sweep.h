// The job in three steps, for those that run a part of it: read the input, plan, sweep a span of slabs.
#pragma once
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "lamina/points.h"
#include "lamina/run.h"
#include "lamina/surface.h"
#include "levelset/surface_volume.h"
#include "meshes/mesh_sink.h"
#include "reconstruct/mesh_output.h"
#include "reconstruct/plan.h"
#include "reconstruct/slab_span.h"
#include "reconstruct/stopwatch.h"
#include "store/ingest.h"

namespace lamina {

/// A cloud in its store, with what is known of where it came from.
struct SweepInput {
  PointSourceInfo info;
  Frame frame;
  Ingested ingested;
  std::optional<RadiusSurvey> radii{};  ///< where they have been surveyed already
};

/// Runs `work` with the threads and in the arena of a job.
void run_in_arena(const RunContext& run, const std::function<void()>& work);

/// Folder for temporary files: next to the output unless told otherwise.
std::string temporary_directory(const SurfaceSettings& settings, const RunContext& run);

/// Throws Error(usage) where an output is one of the inputs, or two outputs are one file.
void require_two_files(const SurfaceSettings& settings);

/// Files and folders that the settings name, as one list.
std::vector<std::string> input_names(const SurfaceSettings& settings);

/// The frame asked for: the settings' own, else what suits what is wanted.
FrameMode chosen_frame(const SurfaceSettings& settings);

/// The settings' input: a kept one (kept_input.h) is opened; others are read into a store in `directory`: unnamed
/// files, or, with `keep`, named ones that stay. Normals are found on the way where the settings ask for them
/// (stats.normals).
SweepInput read_surface_input(const SurfaceSettings& settings, const std::string& directory, bool keep,
                              const RunContext& run, Stopwatch& watch, SurfaceStats& stats);

/// Opens everything named, as one stream; says what the readers found worth saying. Throws Error(unreadable) for
/// coordinates in degrees.
std::unique_ptr<PointSource> open_inputs(const SurfaceSettings& settings, const std::string& tmp_dir,
                                         const RunContext& run);

/// Resolves and reports the plan; fills in stats.plan and what was read. `elapsed`: seconds since the job began.
/// Throws Error(empty) where the samples lie too far apart, Error(budget) where they need too much memory.
Resolved plan_surface(const SurfaceSettings& settings, const SweepInput& input, const RunContext& run, Stopwatch& watch,
                      double elapsed, SurfaceStats& stats);

/// The mesh file's layout, without its name.
MeshSinkSettings mesh_layout(const SurfaceSettings& settings, const SweepInput& input, const Resolved& resolved);

/// The sweep through `span` of all_slabs(): finished slabs go to the sink (see Pipeline). Fills in the stats of stages.
void sweep(const SurfaceSettings& settings, SweepInput& input, const Resolved& resolved, const SlabSpan& span,
           SlabSink& sink, SurfaceVolume* volume, const RunContext& run, Stopwatch& watch, SurfaceStats& stats);

/// Times and memory of the whole process since `began`.
void finish_stats(const Stopwatch& watch, const Stopwatch::Moment& began, SurfaceStats& stats);

/// Throws Error(empty) for a mesh without triangles.
[[noreturn]] void no_surface(const std::string& input, std::uint64_t samples);

}  // namespace lamina

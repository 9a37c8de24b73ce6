// The plan of a reconstruction: everything that the sweep, its parts, the volume and the statistics need to know of the
// settings and the cloud, derived once and never changed.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "boundary/hole_closer.h"
#include "isosurface/extract.h"
#include "lamina/surface.h"
#include "lattice/lattice.h"
#include "meshes/mesh_sink.h"
#include "mls/project.h"
#include "mls/refit_normals.h"
#include "reconstruct/mesh_output.h"
#include "reconstruct/pruner.h"
#include "reconstruct/stages.h"
#include "reconstruct/stored_cloud.h"
#include "samples/sample_feed.h"

namespace lamina {

/// What a run is expected to take.
struct ExpectedCost {
  std::uint64_t memory = 0;    ///< bytes, at the peak
  std::uint64_t disk = 0;      ///< bytes of temporary files, at the most
  double cpu_seconds = 0;      ///< of the whole run, on the machine that the model was made on
  double reading_seconds = 0;  ///< of these for reading the input
};

/// The influence radius R that goes with a cell, input units.
struct RadiusRule {
  double per_cell = 1;  ///< for each step of its side
  double least = 0;     ///< whatever the cell
};

/// Lengths are in fixed-point steps of the frame where nothing else is said.
struct ReconstructionPlan {
  // The cloud.
  std::string input;  ///< what messages call it
  std::uint64_t samples = 0;
  std::uint64_t buckets = 0;
  Frame frame;  ///< of what comes out: less the shift where one is asked for
  Extent extent;
  AttributeLayout attributes;
  bool given_radii = false;
  RadiusSurvey radius;  ///< scaled and bounded as the samples' own are
  bool lines = false;   ///< SupportSurvey::lines

  // The octree.
  Lattice lattice;
  int main_level = 0;  ///< of most cells
  SlabSpan slabs;      ///< all that can hold surface
  int window = 1;      ///< slabs that each stage advances at once

  // The stages.
  RadiiSettings radii;
  FeedSettings feed;
  RefitSettings refit;
  ProjectSettings projection;
  float boundary = 0;  ///< SurfaceSettings::boundary
  DoubtfulPoints doubtful = DoubtfulPoints::near_samples;
  ClusterMode cluster = ClusterMode::preserving;
  float chord = 0;                ///< SurfaceSettings::chord
  bool vertex_levels = false;     ///< SurfaceSettings::vertex_levels
  bool vertex_curvature = false;  ///< SurfaceSettings::vertex_curvature
  RadiusRule vertex_radii;        ///< the influence radius around each vertex, by the finest cell around its corner
  double trim = 0;                ///< R, > 0: the mesh is cut where its overhang is this (boundary/rims.h)
  bool settle_normals = false;    ///< triangles have a say in their vertices' normals (clustering/settled_normals.h)
  HoleSettings holes;
  PruneRule pruning;
  SimplifySettings simplify;
  VolumeExport volume;
  TileSettings tiles;
  std::vector<std::string> comments;  ///< of the mesh file
  AttributeLayout mesh_attributes;
  bool double_positions = false;
  std::uint64_t waiting_vertex_bytes = 0;  ///< of a vertex that lies on disk until its mesh's format can be written

  ExpectedCost expected;

  /// The slabs each stage works on for the finished slabs of a span.
  [[nodiscard]] StageSpans stages_of(const SlabSpan& span) const {
    return {span, slabs, {projection.centres, projection.creases, settle_normals}};
  }
};

/// Throws Error(usage) for settings out of range. Called before the input is opened.
void check_settings(const SurfaceSettings& settings);

/// A function of settings, cloud and survey alone, so that all parts of a job plan the same. Throws Error(usage) when
/// the cell asked for cannot be represented for this cloud, or vertices would have two attributes of one name;
/// Error(empty) where no sampling density can be estimated.
ReconstructionPlan make_plan(const SurfaceSettings& settings, const StoredCloud& cloud, const CloudSurvey& survey);

/// Whether supports are to average: noise beyond what detail looks like, or less that asks for wide supports.
bool is_noisy(const RadiusSurvey& radii, const SupportSurvey& support);

/// What make_plan() wants to know of a cloud: radii and noise, and where H is to be chosen and the cloud is noisy, H by
/// place. `read`: as for survey_radii().
CloudSurvey survey_cloud(const SurfaceSettings& settings, const SlabStore& store, const ReadBucket& read);

/// The part of make_plan() that says how far samples act and how fine the cells are, what is trusted and what closed:
/// as the user says, else by what the survey saw of the cloud. Lengths that need the lattice are left for the rest of
/// it.
void choose_support(const SurfaceSettings& settings, const CloudSurvey& survey, const PointSourceInfo& info,
                    ReconstructionPlan& plan);

/// SimplifySettings::deviation of a mesh of such samples: noise says how much of what is not flat is none of the
/// surface's.
double choose_deviation(const RadiusSurvey& survey);

/// The mesh file's layout, without its name.
MeshSinkSettings mesh_layout(const ReconstructionPlan& plan);

/// Bytes of the store that the sweep reads for a span of slabs: samples with z in [from, to); no `from`: from the
/// bottom.
struct ZRead {
  std::optional<std::int64_t> from;
  std::int64_t to = 0;
};
ZRead z_read(const ReconstructionPlan& plan, const SlabSpan& span);

/// How far beyond a slab samples may lie that act on its corners.
double sample_reach(const ReconstructionPlan& plan);

/// All samples that act on slabs before `end`, or mark cells there, lie below. `reach`: sample_reach().
std::int64_t samples_end(const Lattice& lattice, std::int64_t end, double reach);

/// What the plan comes to in the input's units; time and threads are not known yet.
SurfacePlan summary_of(const ReconstructionPlan& plan);

/// The summary in lines for a reader.
std::string describe(const SurfacePlan& plan);

/// What was seen of a cloud and chosen for it, in two or three lines for a reader; SurfacePlan has the same as numbers:
/// the samples, their scans, spacing, noise and where it is most, normals and strays; then every choice that the
/// settings left open, as the option that would have made it.
std::string describe_findings(const SurfaceSettings& settings, const SurfaceStats& stats);

// What a run is expected to take: memory, temporary disk, processor time. The models' coefficients are fitted to runs
// of 1 M to 380 M samples (docs/performance.md).

/// Of the mesh.
double expected_triangles(const ReconstructionPlan& plan);
/// Triangles that a square cell of surface gives.
double triangles_per_cell(ClusterMode cluster);

/// The whole of it, for a plan that is complete but for its cost.
ExpectedCost expected_cost(const ReconstructionPlan& plan, const Ingested& cloud);

/// Processor seconds of a whole run on the machine the model was made on.
double expected_cpu_seconds(const ReconstructionPlan& plan);

/// The window's look-up tables cover all the slabs a bucket of samples lies in, empty ones too: next to nothing, unless
/// a few samples are scattered over a long way.
std::uint64_t table_bytes(const ReconstructionPlan& plan, const SlabStore& store);

}  // namespace lamina

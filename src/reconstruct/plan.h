// The plan of a reconstruction: everything that the sweep, its parts, the volume and the statistics need to know of the
// settings and the cloud, derived once and never changed.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "boundary/hole_closer.h"
#include "isosurface/number_edges.h"
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
  VertexSettings vertices;
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
  [[nodiscard]] StageSpans stages_of(const SlabSpan& span) const { return {span, slabs, projection.centres}; }
};

/// Throws Error(usage) for settings out of range. Called before the input is opened.
void check_settings(const SurfaceSettings& settings);

/// A function of settings, cloud and survey alone, so that all parts of a job plan the same. Throws Error(usage) when
/// the cell asked for cannot be represented for this cloud, or vertices would have two attributes of one name;
/// Error(empty) where no sampling density can be estimated.
ReconstructionPlan make_plan(const SurfaceSettings& settings, const StoredCloud& cloud, const RadiusSurvey& survey);

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

/// What the plan comes to in the input's units; time and threads are not known yet.
SurfacePlan summary_of(const ReconstructionPlan& plan);

/// The summary in lines for a reader.
std::string describe(const SurfacePlan& plan);

/// What was seen of a cloud and chosen for it, in two or three lines for a reader; SurfacePlan has the same as numbers:
/// the samples, their scans, spacing, noise and where it is most, normals and strays; then every choice that the
/// settings left open, as the option that would have made it.
std::string describe_findings(const SurfaceSettings& settings, const SurfaceStats& stats);

}  // namespace lamina

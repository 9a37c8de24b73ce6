// The main job: oriented points in, streamed triangle mesh out.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "lamina/align.h"
#include "lamina/attributes.h"
#include "lamina/clean.h"
#include "lamina/clustering.h"
#include "lamina/frame.h"
#include "lamina/holes.h"
#include "lamina/length.h"
#include "lamina/mesh_receiver.h"
#include "lamina/normals.h"
#include "lamina/points.h"
#include "lamina/run.h"
#include "lamina/simplify.h"
#include "lamina/tiles.h"
#include "lamina/volume_export.h"

namespace lamina {

/// What is fitted to the samples around a point (Cuccuru et al. 2009, section 3.2): a weighted plane, or the algebraic
/// sphere of Guennebaud and Gross 2007.
enum class FitMode { plane, sphere };
/// Whose normals are used.
enum class NormalsChoice {
  file,       ///< the input's; an input without any is refused
  automatic,  ///< the input's where they are usable; the others are found (NormalsMode::complete). Where its signs
              ///< contradict each other they are found, too (NormalsMode::reorient); all, where they are of no surface
  estimate,   ///< all are found, whatever the input has
};

/// The job. Lengths are in the input's units; a Length may be in multiples of the radius instead (length.h).
struct SurfaceSettings {
  std::string input;  ///< point file, folder, pattern or scan list (expand_inputs()); "-" is standard input
  std::vector<std::string> more_inputs;  ///< taken together with `input`, as one cloud
  /// Opens the cloud where it is no file, as view_points() does; `input` then only names it in messages. Not for jobs
  /// of several runs.
  std::function<std::unique_ptr<PointSource>()> open;
  PointSettings reading;                   ///< how the files are read; temporary files are the run's affair
  std::string output;                      ///< mesh file: .obj, .off, .stl, .glb, else PLY; "-": standard output
  std::vector<std::string> more_outputs;   ///< the same mesh in further files, each in its own format
  std::shared_ptr<MeshReceiver> receiver;  ///< takes the mesh instead of these files; of reconstruct_surface() alone

  std::optional<FrameMode> frame;  ///< unset: pca, or axis where grids are asked for (they have the input's axes then)
  BadSamples bad_samples = BadSamples::drop;  ///< non-finite, without a normal, with a radius <= 0
  /// Unset: automatic, but of a large input a million rows are looked at, and where no more than a hundredth lacks a
  /// normal it is dropped. A store's stay.
  std::optional<NormalsChoice> normals;
  NormalsSettings normal_search;  ///< how normals are found; its mode and bad_samples are those of this job
  /// Scans that disagree a little are moved until they agree (align_scans()); a store's stay as they are.
  bool align = false;
  bool guess_trade = false;    ///< say what the cloud is taken for; normals that are found face as is usual there
  double radius_scale = 1;     ///< > 0: multiplies every sample's radius, given or estimated
  std::uint32_t density = 16;  ///< samples a counting cell must hold to give a radius (Cuccuru et al. 2009, 3.1), >= 2
  CleanSettings clean;         ///< what is left out before radii are estimated
  Length max_radius;           ///< samples with a larger radius are discarded as undersampled; 0: none
  /// H > 0: the influence radius R = H r (section 3.2). Unset: chosen by the noise of the cloud, from place to place,
  /// and the evenness of its sampling, together with `cell` and `refit` where these are unset (SurfacePlan holds the
  /// choice).
  std::optional<double> blend = 1.2;
  /// 0..8, radii: before anything is projected each normal is replaced by that of the sphere fitted to the samples
  /// within this distance that face the same way; 0: normals stay. Unset: chosen where `blend` is, else 0.
  std::optional<double> refit;
  int steps = 1;                 ///< projection steps, 1..16; 0: as many as each corner needs, at most 16
  double step_tolerance = 0.01;  ///< with 0 steps: a corner is done when a step moves it no farther than this, in r
  FitMode fit = FitMode::sphere;
  bool diffuse = false;        ///< project cell centres, and corners by their cells (section 3.3)
  std::optional<Length> cell;  ///< largest leaf cell a radius allows; leaves are half to all of it. Unset: chosen where
                               ///< `blend` is, else 0.9 R
  int levels = 0;              ///< octree levels, 1..12; 0: as the radii ask, at least 4
  double boundary = 0;         ///< R: isovertices whose corners project farther than this from the average of their
                               ///< samples are rejected; 0: no limit
  ClusterMode cluster = ClusterMode::preserving;
  double chord = 0.2;          ///< outward shift of clustered vertices, in curvature times cell size squared; 0: none
  bool vertex_levels = false;  ///< give vertices an attribute `level`: the octree level, 0 the finest
  /// Give vertices an attribute `curvature`: mean curvature of the fitted sphere, 1 / input unit, positive where the
  /// surface is convex.
  bool vertex_curvature = false;
  bool vertex_filled = false;  ///< give vertices an attribute `filled`: 1 where one was added to close a hole, else 0
  /// Boundary loops shorter than this, in local influence radii R, are closed where the surface around them tells how
  /// (boundary/fill.h). 0, or ClusterMode::free: none are. R is taken from the cells of the octree, which follow it by
  /// powers of two. Unset: 300, gaps up to some hundred radii wide.
  std::optional<double> close_holes = 8;
  /// Close all loops where none is left that is longer than 24 R and whose surface does not lead into it: the scanned
  /// object is taken to be closed then. Unset: chosen where `blend` is (where the samples came with normals, only if
  /// none longer than 24 R is left), else false.
  std::optional<bool> watertight;
  /// Bridge gaps with bent rims where the surface leads into them from all around (HoleSettings::bridge). Unset: where
  /// `blend` is chosen and gaps are what nobody saw: in clouds of several scans, and in those that came without
  /// normals.
  std::optional<bool> bridge;
  /// Close everything: what `close_holes`, `bridge` and `watertight` leave open gets surfaces that rest on nothing but
  /// its rim. Vertices get an attribute `invented`: 1 where one was added for that, else 0. Not with ClusterMode::free.
  bool fill_all = false;
  /// R, 0 <= trim < 1: the mesh is cut along the curve where it reaches so far beyond the samples that carry it (where
  /// their weighted mean lies so far to one side); 0.235 is the straight edge of evenly spread samples. 0: nowhere,
  /// whole triangles are kept or left out. Unset: chosen where `blend` is, else 0.
  std::optional<double> trim;
  /// Sharp edges: where the normals around a corner fall into two or three groups, each is fitted by itself, vertices
  /// are put on the edges and corners where they meet, and normals that a clean cloud has interpolated over such edges
  /// are found again. Where the data show none nothing changes. Unset: where `blend` is and the cloud is
  /// clean.
  std::optional<bool> features;
  /// Connected parts of the mesh with fewer triangles are dropped. Unset: those under which fewer than sixty samples
  /// lie, or than one in 5000 of a small cloud; in jobs of several runs, which write no whole mesh, none.
  std::optional<std::uint64_t> prune_triangles = 0;
  Length prune_size;   ///< so are parts whose box has a shorter diagonal; `r`, `R`: of the median sample; 0: none
  bool local = false;  ///< subtract a shift (SurfaceStats::shift) from coordinates, so that floats hold them
  int window = 1;      ///< >= 1: slabs that each stage advances at once; more is faster on many cores and takes memory
  bool dry_run = false;  ///< only plan: read the input, write nothing
  /// A point file for the samples that `clean` leaves out by looking around, in the input's coordinates (as exact as
  /// the store keeps them), with their attributes and one called `reason`: 1 merged, 2 outlier, 3 stray far from its
  /// neighbours, 4 stray on no surface of theirs, 5 thinned out. Empty: none. Not for jobs of several runs, nor for
  /// stores, which were cleaned when they were made.
  std::string rejected;
  SimplifySettings simplify;  ///< how far the finished mesh is simplified, before it appears; nothing: it is not
  /// Where `simplify` says nothing: SimplifySettings::deviation, 0 to 1; 0: all triangles stay. Unset: by the noise of
  /// the cloud.
  std::optional<double> deviation = 0;
  VolumeExport volume;  ///< grids to write beside the mesh
  TileSettings tiles;   ///< 3D Tiles to write beside the mesh; their coordinate system is the input's
};

/// What the settings mean for this cloud. Lengths in the input's units.
struct SurfacePlan {
  std::uint64_t samples = 0;       ///< usable
  std::uint64_t scans = 1;         ///< that the input tells apart
  double overlap = 0;              ///< share of the places that several of them saw; 0 in jobs of several runs
  std::array<double, 3> extent{};  ///< of the bounding box along the axes of the frame, sweep axis last
  double radius_low = 0, radius_median = 0, radius_high = 0;  ///< 1 %, 50 %, 99 % of r
  double noise = 0;                  ///< median distance of samples from the surface their neighbours suggest, in radii
  double high_noise = 0;             ///< a tenth of them lies farther from it, in radii
  double worst_noise = 0;            ///< median in the noisiest of a few stretches of the cloud, in radii
  std::array<double, 3> noisiest{};  ///< the middle of that stretch
  double normal_noise = 0;           ///< median angle of their normals to that surface's, degrees
  double blurred_normals = 0;        ///< share of normals that are interpolated over sharp edges
  bool lines = false;                ///< samples lie on lines far apart, such as profiles; not looked at with `blend`
  double blend = 0, refit = 0;       ///< as given or chosen, about that where they follow places
  double least_blend = 0, most_blend = 0;  ///< of all places
  Length cell;
  bool refine_sheets = false;  ///< half of it where things are thin
  bool watertight = false;     ///< as given or chosen
  bool bridge = false;         ///< as given or chosen
  double trim = 0;             ///< R, as given or chosen
  bool features = false;       ///< as given or chosen
  double deviation = 0;        ///< as given or chosen
  bool sharpen = false;        ///< blurred normals are found again
  double longest_rim = 0;      ///< R, of boundary loops to be closed: close_holes as given or chosen
  double finest_cell = 0;
  int levels = 0;
  double slab_height = 0;
  std::int64_t slabs = 0;
  std::uint64_t buckets = 0;
  std::uint64_t disk_bytes = 0;  ///< most temporary disk at once, expected: the samples' store (measured) and the faces
  std::uint64_t memory_bytes = 0;  ///< peak memory, expected
  int threads = 1;                 ///< what `seconds` is for
  double seconds = 0;  ///< wall clock of the whole run, expected of this machine at the speed it read the input
};

struct StageTime {
  std::string stage;
  double wall = 0;         ///< seconds
  double cpu = 0;          ///< seconds, all threads
  double partly_idle = 0;  ///< seconds of `wall` in which fewer than all threads had work
};

struct Rejected {
  std::string reason;
  std::uint64_t count = 0;
  std::optional<std::uint64_t> first_row;  ///< of the input, counted from 0, where known
};

/// Connected parts of the mesh, where some were to be dropped.
struct PruneCounts {
  std::uint64_t kept = 0, removed = 0, removed_triangles = 0;
};

struct SurfaceStats {
  SurfacePlan plan;
  std::uint64_t samples_read = 0;
  std::string crs;  ///< coordinate reference system of the input (PointSourceInfo::crs)
  ScanAlignment alignment;
  CleanCounts cleaned;
  PruneCounts pruned;
  std::array<double, 3> shift{};          ///< SurfaceSettings::local: add it to the coordinates written
  std::vector<Rejected> rejected;         ///< samples left out, by reason
  std::uint64_t replaced_attributes = 0;  ///< attribute values that were NaN or out of range
  std::uint64_t vertices = 0, triangles = 0;
  std::uint64_t corners = 0, corners_seen = 0, corners_trusted = 0;
  std::uint64_t corner_sums = 0;  ///< how often samples were summed up at a corner: once for each of its steps
  /// Corners whose samples' normals contradict each other; the slab (counted from the first) with the largest share of
  /// them among the corners with samples, and that share.
  std::uint64_t corners_torn = 0;
  std::int64_t torn_slab = 0;
  double torn_share = 0;
  std::uint64_t isovertices = 0, isotriangles = 0, rejected_loops = 0, general_cells = 0, crossing_cells = 0;
  std::vector<std::uint64_t> leaf_cells;  ///< by level, finest first
  ClusterCounts clusters;
  HoleStats holes;
  SimplifyStats simplified;              ///< where that was asked for; `vertices` and `triangles` are those left
  std::optional<NormalsReport> normals;  ///< where they were found
  VolumeExportStats volume;              ///< where grids were asked for
  TileStats tiles;                       ///< where they were asked for
  std::vector<StageTime> stages;
  double wall = 0, cpu = 0;
  int threads = 1;
  double partly_idle = 0;         ///< as of StageTime
  std::uint64_t peak_memory = 0;  ///< bytes, of the process
  std::uint64_t disk_bytes = 0;   ///< temporary: the most that the samples' store and the faces took at once
};

/// Reconstructs the surface of a cloud (Cuccuru et al. 2009; docs/method.md) and streams it to a mesh file. Reports the
/// plan through run.info() and progress through run.progress. The bytes are the same for any number of threads and any
/// window. Throws Error: unreadable (the input), usage (settings out of range, or that contradict each other or the
/// cloud), budget (run.max_memory, before the sweep; disk; output), empty (no surface), internal (cancelled).
SurfaceStats reconstruct_surface(const SurfaceSettings& settings, const RunContext& run);

}  // namespace lamina

// Normals for points that have none, and signs for normals that have no side: found while the cloud streams by.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "lamina/points.h"
#include "lamina/run.h"
#include "lamina/sample.h"

namespace lamina {

enum class NormalsMode {
  estimate,  ///< all are found anew, whatever the input has
  complete,  ///< those the input lacks (missing, zero or not finite) are found; the others stay as they are
  reorient,  ///< the input's directions stay, their signs are found anew; those it lacks are found
  check,     ///< the input's stay as they are: only the report is wanted
};

/// A side to look from.
struct Viewpoint {
  std::array<double, 3> at{};  ///< input coordinates: where a scanner stood
  bool direction = false;      ///< `at` is the direction towards a scanner far away instead (up, for one in the air)
};

struct NormalsSettings {
  NormalsMode mode = NormalsMode::estimate;
  int k = 16;  ///< 3..64: nearest samples a plane is fitted to
  double radius =
      0;  ///< input units, >= 0; above 0: all samples within it instead, the k nearest where they are too few
  std::vector<Viewpoint> viewpoints;  ///< normals face the nearest of them. As many as the input has scans
                                      ///< (PointSourceInfo::scans), if more than one: each is one scan's
  bool scanners = true;       ///< where the input knows its scanners (ScanPart) and none are given, normals face these
  bool pose_origins = false;  ///< the origin of an input with a pose counts as its scanner
  bool flip = false;          ///< turn everything round at the end: rooms seen from inside, without a viewpoint
  BadSamples bad_samples = BadSamples::drop;  ///< what to do about positions that are not finite
};

/// Neighbours that are near along the surface, and those of them whose normals point to opposite sides.
struct SignConflicts {
  std::uint64_t pairs = 0, conflicts = 0;
  [[nodiscard]] double share() const {
    return pairs == 0 ? 0.0 : static_cast<double>(conflicts) / static_cast<double>(pairs);
  }
};

struct NormalsReport {
  std::uint64_t samples = 0;       ///< looked at: those with finite positions
  std::uint64_t estimated = 0;     ///< directions found
  std::uint64_t flipped = 0;       ///< given normals whose sign changed
  std::uint64_t without = 0;       ///< samples that got none: too few neighbours, or all on a line. They have 0 0 0
  std::uint64_t by_viewpoint = 0;  ///< whose sign follows from a viewpoint, directly or through neighbours
  std::uint64_t by_given = 0;      ///< from normals of the input that stay
  std::uint64_t by_outside = 0;    ///< from what is outside: the volume their surface encloses is positive
  std::uint64_t unsure = 0;        ///< of these, on surfaces so open or flat that this says little: lying ones face +z
  std::uint64_t patches = 0, components = 0;  ///< pieces that signs were found for; surfaces no link joins
  SignConflicts conflicts;                    ///< of the result
  std::vector<SignConflicts> slabs;           ///< of the result, by slab of the sweep
  [[nodiscard]] std::size_t worst_slab() const;
};

/// The same points with normals. Each gets the plane through its nearest samples (principal component analysis); the
/// sign comes from the viewpoints, or from given normals that stay, or else is such that every surface's outside is
/// out; it travels along links between neighbours, first within patches of some 64 samples or more, then between
/// patches over a spanning tree (docs/normals.md). Samples that get no normal have 0 0 0.
///
/// Reads the input twice before this returns, and once more through the result, whose rows are those of `source`, in
/// order, and random_access as it is. Memory goes with the cloud's cross-section and the number of patches (some
/// 300 000 at most in a cloud of even density); positions and results rest in unnamed files in
/// run.tmp_dir (empty: the system's). The result does not depend on threads.
/// Throws Error: usage (settings out of range, check without normals), empty (no points, or all at one place), budget
/// (disk; run.max_memory, before the sweep), and what the source throws.
std::unique_ptr<PointSource> with_normals(std::unique_ptr<PointSource> source, const NormalsSettings& settings,
                                          NormalsReport& report, const RunContext& run = {});

/// A line that says what came out, for a reader.
std::string describe(const NormalsReport& report);
/// Warns where the share of sign conflicts, in all or in the worst slab, is such that a surface will be torn.
void warn_of_conflicts(const NormalsReport& report, const std::string& path, const RunContext& run);

}  // namespace lamina

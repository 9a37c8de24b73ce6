// Normals for points that have none, and signs for normals whose side is unknown; found while the cloud streams by;
// and what a cloud was recorded for.
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/points.h"
#include "lamina/run.h"

namespace lamina {

/// Which normals are found, and which stay.
enum class NormalsMode {
  estimate,  ///< all are found, whatever the input has
  complete,  ///< those the input lacks (missing, zero or not finite) are found; the others stay as they are
  reorient,  ///< the input's directions stay, their signs are found; those it lacks are found
  check,     ///< all stay as they are: only the report is wanted
};

/// A place or direction that a surface was seen from.
struct Viewpoint {
  std::array<double, 3> at{};  ///< input coordinates: where a scanner stood
  bool direction =
      false;  ///< `at` is the direction to a distant scanner instead, of any length but 0 (up: one in the air)
};

/// How normals are found.
struct NormalsSettings {
  NormalsMode mode = NormalsMode::estimate;
  int k = 16;  ///< 3..64: the number of nearest samples that a plane is fitted to
  /// Input units, >= 0. Above 0 the plane is fitted to all samples within it, or the k nearest where these are too few.
  double radius = 0;
  /// Normals face the nearest of these. Where there are several and the input has as many scans
  /// (PointSourceInfo::scans), each belongs to one scan.
  std::vector<Viewpoint> viewpoints;
  bool scanners = true;       ///< without viewpoints, normals face the scanners that the input knows (ScanPart)
  bool pose_origins = false;  ///< the origin of an input with a pose counts as its scanner
  bool flip = false;          ///< turn all normals at the end: for rooms seen from inside, without a viewpoint
  BadSamples bad_samples = BadSamples::drop;  ///< rows whose position is not finite
};

/// Pairs of neighbours along the surface, and how many of them have normals on opposite sides.
struct SignConflicts {
  std::uint64_t pairs = 0, conflicts = 0;
  /// 0..1.
  [[nodiscard]] double share() const {
    return pairs == 0 ? 0.0 : static_cast<double>(conflicts) / static_cast<double>(pairs);
  }
};

/// What was found.
struct NormalsReport {
  std::uint64_t samples = 0;       ///< with finite positions
  std::uint64_t estimated = 0;     ///< directions found
  std::uint64_t flipped = 0;       ///< given normals whose sign changed
  std::uint64_t without = 0;       ///< samples left with 0 0 0: too few neighbours, or all on a line
  std::uint64_t by_viewpoint = 0;  ///< samples whose sign follows from a viewpoint, directly or through neighbours
  std::uint64_t by_given = 0;      ///< samples whose sign follows from normals of the input that stay
  std::uint64_t by_outside = 0;    ///< samples whose sign makes the volume that their surface encloses positive
  std::uint64_t by_inside = 0;     ///< samples of a room that was seen from inside: they face into it
  std::uint64_t by_up = 0;         ///< samples of ground in a wide, flat and level cloud: they face +z
  std::uint64_t by_sight = 0;      ///< samples that face the side from which one sees farther
  std::uint64_t unsure = 0;        ///< samples on other open surfaces: level ones face +z, the rest outwards if that
                                   ///< means anything
  std::uint64_t patches = 0, components = 0;  ///< patches of one sign; surfaces that no link joins
  SignConflicts conflicts;                    ///< of the result
  std::vector<SignConflicts> slabs;           ///< of the result, by slab of the sweep
  /// Index into `slabs` of the largest share of conflicts among slabs with a fair number of pairs.
  [[nodiscard]] std::size_t worst_slab() const;
};

/// The same points with normals of length 1. A normal is that of the plane through the nearest samples (principal
/// component analysis, as Hoppe et al. 1992). Its sign follows from the viewpoints, else from given normals that stay,
/// else from the volume that the surface encloses. Signs travel along links between neighbours: first within patches of
/// some 64 samples or more, then between patches over a spanning tree (docs/normals.md). Samples that get no normal
/// have 0 0 0. Organised scans whose scanner is known take their normals from the faces between neighbouring places of
/// the grid instead.
///
/// Reads the input twice before it returns, and once more through the result, which has the rows of `source` in order
/// and is random_access where that is. Memory grows with the cross-section of the cloud and the number of patches, at
/// most some 300,000 in a cloud of even density; positions and results lie in unnamed files in run.tmp_dir (empty: the
/// system's). The result does not depend on threads.
/// Throws Error: usage (settings out of range, `check` without normals), empty (no points, or all at one place), budget
/// (disk; run.max_memory, before the sweep), and what the source throws.
std::unique_ptr<PointSource> with_normals(std::unique_ptr<PointSource> source, const NormalsSettings& settings,
                                          NormalsReport& report, const RunContext& run = {});

/// One line for the user that says what was found.
std::string describe(const NormalsReport& report);
/// Warns through run.warn() where the share of sign conflicts, in all or in the worst slab, would tear the surface, and
/// where many samples are unsure. `path` names the input.
void warn_of_conflicts(const NormalsReport& report, const std::string& path, const RunContext& run);

/// What a cloud was recorded for, and with what: trades differ in what their clouds need.
enum class Trade : std::uint8_t {
  object,          ///< a thing scanned from all sides, by a turntable, an arm or a structured light scanner
  terrestrial,     ///< rooms, facades, sites from scanners on tripods
  aerial,          ///< ground and roofs from planes and drones, by laser
  handheld,        ///< scanners carried along: many passes over the same places
  photogrammetry,  ///< dense points of photographs
};

/// In the order of Trade.
constexpr std::array<std::string_view, 5> kTradeNames{"object", "terrestrial", "aerial", "handheld", "photogrammetry"};

/// What a cloud looks like.
struct TradeGuess {
  Trade trade = Trade::object;
  std::string because;  ///< in words
};

/// By what the files tell of scanners, returns, classes, extent and colours. Handheld scans have no mark of their own:
/// they are taken for objects.
TradeGuess guess_trade(const PointSourceInfo& info);

/// What was guessed, what follows from it, and how to overrule it: a line for the user.
std::string describe(const TradeGuess& guess);

/// Clouds from the air face up where the settings name neither viewpoints nor directions. Others stay as they are.
void face_by_trade(Trade trade, NormalsSettings& settings);

}  // namespace lamina

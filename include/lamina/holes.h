// Which gaps of a reconstructed mesh are closed, and what became of each.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace lamina {

/// A boundary loop: a closed run of boundary edges.
struct OpenLoop {
  std::array<double, 3> position{};  ///< middle of its box, output coordinates
  double length = 0;                 ///< output units
  double radii = 0;                  ///< the same length in local influence radii
  std::uint64_t edges = 0;
  /// Why it stays open: "long", "outer boundary" (the surface lies inside it), "bent" (the surface around it does not
  /// tell how to continue, or turns away from it), "occupied" (another boundary runs through it).
  std::string reason;
};

/// What tells that the scanned object is closed. Then all loops are closed, whatever lies around them.
enum class Watertight : std::uint8_t {
  no,           ///< nothing does
  short_loops,  ///< that no loop longer than HoleSettings::kWatertight is left
  any_loops,    ///< also that the surface leads into longer ones, by most of their length, and not away from them as at
                ///< the outer boundary of a sheet
};

/// Which boundary loops to close.
struct HoleSettings {
  /// Local influence radii: loops up to this length are closed where the surface around them tells how. 0: none.
  double longest = 8;
  /// Loops up to kWatertight (local influence radii) are closed by the triangulation of least area, longer ones by a
  /// smooth surface (boundary/fill.h).
  Watertight watertight = Watertight::no;
  static constexpr double kWatertight = 24;
  /// Loops up to `longest` around which nothing flat tells how the surface goes on are closed by a smooth surface over
  /// the rim (boundary/fill.h) where the surface leads into them from all around, the more so the longer they are, and
  /// where they are narrow slits.
  bool bridge = false;
  /// Vertices' last attribute says which of them were added: those that are get 1.
  bool mark = false;
  /// What stays open then is closed all the same, by surfaces that rest on nothing but the rims (boundary/fill.h).
  /// Vertices' last attribute says which were added for that (1), the one before it is that of `mark`.
  bool all = false;
};

/// Loops closed and left open; edges are boundary edges.
struct HoleStats {
  std::uint64_t closed = 0, closed_edges = 0;
  std::uint64_t vertices = 0, triangles = 0;  ///< added
  /// Loops closed by invention (not in `closed`), and what was added for them (also in `vertices` and `triangles`).
  std::uint64_t invented = 0, invented_edges = 0, invented_vertices = 0, invented_triangles = 0;
  std::uint64_t open = 0, open_edges = 0;
  double open_length = 0;                      ///< output units
  static constexpr std::size_t kListed = 100;  ///< loops in `longest` at most
  std::vector<OpenLoop> longest;               ///< of those left open, longest first
};

/// One line for a log.
std::string describe(const HoleStats& stats);

}  // namespace lamina

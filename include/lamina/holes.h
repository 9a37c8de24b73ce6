// What became of the gaps of a reconstructed mesh: those closed, and those left open.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace lamina {

/// A closed run of boundary edges.
struct OpenLoop {
  std::array<double, 3> position{};  ///< middle of its box, output coordinates
  double length = 0;                 ///< output units
  double radii = 0;                  ///< the same in local influence radii
  std::uint64_t edges = 0;
  /// Why it stays open: "long", "outer rim" (the surface lies inside of it), "bent" (the surface around does not tell
  /// how it goes on), "occupied" (other boundary runs through it).
  std::string reason;
};

/// Which boundary loops are closed.
struct HoleSettings {
  /// Loops of so many local influence radii are closed where the surface around tells how; 0: none.
  double longest = 8;
  /// Where no loop is longer than kWatertight times that, the cloud is of a closed thing: its loops are all closed,
  /// whatever lies around, by the surface of least area.
  bool watertight = false;
  static constexpr double kWatertight = 3;
};

struct HoleStats {
  std::uint64_t closed = 0, closed_edges = 0;
  std::uint64_t vertices = 0, triangles = 0;  ///< added
  std::uint64_t open = 0, open_edges = 0;
  double open_length = 0;
  static constexpr std::size_t kListed = 100;
  std::vector<OpenLoop> longest;  ///< of those left open, longest first
};

/// One line for a log.
std::string describe(const HoleStats& stats);

}  // namespace lamina

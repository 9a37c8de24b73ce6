// Closes the holes of a mesh that streams by, behind its end.
#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "boundary/boundary.h"
#include "boundary/fill.h"
#include "lamina/holes.h"
#include "meshes/distinct_positions.h"
#include "meshes/mesh_sink.h"

namespace lamina::boundary {

/// A mesh is taken for that of a closed thing while its boundary has at most one edge for so many vertices: an open
/// surface has one long boundary loop at least, unless it is so small that the loop is a good part of it (no more than
/// fifteen vertices an edge). The dragon's, whose whiskers leave many loops, has four hundred; a small scan of a part
/// with some holes 75.
inline constexpr std::uint64_t kLeastVerticesPerEdge = 40;
/// The surface leads into a loop where Closure::leads_in is at least this (84 degrees).
inline constexpr double kLeadsIn = 0.1;
/// Of the length of the wide loops of a closed thing the surface leads away from no more: what is missing of it is
/// wider than the places where its rim happens to turn off.
inline constexpr double kMostLeadsAway = 0.2;
/// A gap is bridged where Closure::leads_in is at least this much, and so much more for each influence radius of its
/// rim: at rims of 10 radii 70 degrees on the average, of 25 60, of 50 41. What a wide gap hides may look otherwise.
inline constexpr double kBridgeLeadsIn = 0.25;
inline constexpr double kBridgePerRadius = 0.012;
/// So is a slit (Closure::width), whatever its sides do, as between an edge and what lies a little behind it: a bridge
/// misses by half of that at most. In the narrowest, the two sides of one line of edges, triangles would have no area.
inline constexpr double kSlit = 0.5;
inline constexpr double kLeastSlit = 0.02;
/// Other loops run through a filling with no more vertices than this for each of the rim: scraps of surface that lie
/// on it here and there, as noise and scans that disagree leave them, say nothing against it.
inline constexpr double kMostOccupied = 0.1;
/// Loops of more edges are not looked at, whatever their length, but where all are to be closed.
inline constexpr std::uint64_t kMostEdges = 4096;

/// What comes behind a mesh: its triangles name the mesh's vertices, and the new ones behind them.
struct Addition {
  VertexBatch vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// Takes the boundary loops as they are found. Memory: boundary loops that are not closed yet, and closed loops that
/// may be filled; of all loops where all are to be. What comes out depends on the mesh alone, not on the order of the
/// batches.
class HoleCloser {
 public:
  /// `attributes`: of a vertex; `double_positions`: as they are written.
  HoleCloser(const HoleSettings& settings, std::size_t attributes, bool double_positions);
  HoleCloser(const HoleCloser&) = delete;
  HoleCloser& operator=(const HoleCloser&) = delete;

  /// `first`: the vertex that the batch's numbers count from.
  void add(const BoundaryBatch& batch, std::uint64_t first = 0);
  /// The next part of a mesh, its first vertex `first`: its loose edges meet those of the part before.
  void add_part(const BoundaryBatch& batch, std::uint64_t first);
  /// The mesh, of so many vertices, is complete.
  Addition finish(std::uint64_t vertices);
  [[nodiscard]] const HoleStats& stats() const { return stats_; }

 private:
  [[nodiscard]] double bound() const;  ///< of loops that are looked at, radii
  void take(Loop&& loop, const LoopExtent& extent);
  void leave(const LoopExtent& extent, Verdict why);
  /// What becomes of a loop.
  struct Closing {
    Filling filling;
    std::vector<std::size_t> islands;  ///< loops that the filling joins
    [[nodiscard]] bool is_closed() const {
      return filling.verdict == Verdict::filled || filling.verdict == Verdict::joined;
    }
  };
  void fill_all(std::vector<Closing>& closings) const;
  /// Loops that run through a filling, and how many of their vertices do.
  using Occupants = std::map<std::size_t, std::size_t>;
  /// By loop, the others in its filling.
  [[nodiscard]] std::vector<Occupants> find_occupants(const std::vector<Closing>& closings) const;
  /// Takes out of each gap's occupants those that are holes in the surface along its rim.
  void pass_over_holes_beside(const std::vector<Closing>& closings, std::vector<Occupants>& occupants) const;
  /// Whether a filling would be one surface twice.
  [[nodiscard]] bool is_occupied(std::size_t gap, const Occupants& occupants) const;
  /// Fills around the occupants where they are islands; false where they are not, or no filling goes around them.
  bool take_islands(std::size_t outer, const Occupants& occupants, const std::vector<Closing>& closings,
                    Closing& out) const;
  void settle_occupied(std::vector<Closing>& closings) const;
  /// Closes what is `bent` where the surface leads into it, and slits (where one steps back behind itself the plane
  /// across its mean normal may see an outer boundary), as far as no other loop lies in the way.
  void bridge_gaps(std::vector<Closing>& closings) const;
  [[nodiscard]] bool is_wide(std::size_t l) const { return loops_[l].second.radii > HoleSettings::kWatertight; }
  /// Whether the short loops that are left look like those of a closed thing.
  [[nodiscard]] bool may_be_closed_thing(std::uint64_t vertices, const std::vector<Closing>& closings) const;
  /// Closes the longer ones that are left, all or none, as most of their length says; whether none remains.
  bool close_wide(std::vector<Closing>& closings) const;
  void fill_rest(std::vector<Closing>& closings) const;
  void append(std::size_t l, const Closing& closing, std::uint64_t vertices, Addition& out);
  void invent_rest(std::vector<Closing>& closings);
  void require_all_closed() const;

  HoleSettings settings_;
  std::size_t attributes_;
  DistinctPositions distinct_;
  HoleStats stats_;
  std::vector<std::pair<Loop, LoopExtent>> loops_;
  std::vector<std::pair<Loop, LoopExtent>> long_;  ///< beyond the bounds, where all are to be closed
  BoundaryPaths paths_;
  std::vector<BoundaryEdge> loose_;  ///< of the last part, numbers of the mesh
};

}  // namespace lamina::boundary

// A closed boundary loop's filling: whether the samples around support one, and its triangles.
#pragma once
#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "boundary/boundary.h"
#include "boundary/gap_surface.h"

namespace lamina::boundary {

/// A rim belongs to one surface where its vertices face its way and lie this near to one quadric (influence radii R),
/// about as far as the fit itself may err at a boundary, or this near for the gap's width where that is wide: all but
/// so many of them, since rims are where scans are worst.
inline constexpr double kFarthestFromQuadric = 0.4;
inline constexpr double kFarthestOfWidth = 0.05;
inline constexpr double kMostUnfit = 0.3;
/// Rims of more vertices are triangulated by ears and flips, not by the best of all plans (n^3 steps).
inline constexpr std::size_t kMostPlanned = 100;
/// Facets fold by less than 100 degrees (one less the cosine), with each other and with those around.
inline constexpr double kMostFold = 1.17;
/// Loops no longer than this (R), hardly wider than one sample acts, need no quadric: ends of thin things. Facets there
/// fold by less than 140 degrees, which still tells a gap from the outer boundary of a flake.
inline constexpr double kSmallLoop = 5;
inline constexpr double kMostSmallFold = 1.77;
/// Another loop so near to a filling (R) takes its place: the two would be one surface twice.
inline constexpr double kOccupied = 0.5;
/// But not where all of it lies so near to the rim (R): a hole in the surface that the rim bounds.
inline constexpr double kBesideRim = 1;

enum class Verdict : std::uint8_t {
  filled,
  too_long,        ///< longer than the bound, or of too many edges
  outer_boundary,  ///< the surface lies inside of it
  bent,            ///< normals around it do not agree, or do not belong to one quadric: nothing says what lies between
  occupied,        ///< other boundary loops run through the gap
  joined,          ///< an island's outer boundary: the filling around it goes on to it
  invented,        ///< by a closure that rests on nothing but the rim (close_loop())
};

/// For stats and messages.
const char* describe(Verdict verdict);

/// Triangles name the loop's vertices 0 ... n - 1 in its order, then the new ones.
struct Filling {
  Verdict verdict = Verdict::bent;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<std::array<double, 3>> positions;  ///< of new vertices
  std::vector<std::array<float, 3>> normals;
  std::vector<float> attributes;  ///< as Loop
};

/// The filling of a loop of at most `longest` influence radii. It is a height field over a plane, does not turn back on
/// the triangles around, and uses no edge that the mesh has already. Depends on the loop alone.
Filling fill_loop(const Loop& loop, double longest);

/// The same around islands: parts of the surface that lie in the gap. Triangles name the islands' vertices after the
/// loop's.
Filling fill_around(const Loop& loop, const std::vector<const Loop*>& islands);

/// The filling of least area, whatever lies around: for boundary loops of which is known that they are none of the
/// thing itself. Around a new vertex in the middle where the mesh has too many of the edges that would be needed. A
/// lone triangle's back is no filling.
Filling fill_any(const Loop& loop);

/// What a filling takes up, to find other boundary loops in it.
class FilledPlace {
 public:
  FilledPlace(const Loop& loop, const Filling& filling);
  /// Whether a vertex of another boundary loop lies in the filling, or so near (kOccupied) that the two would be one
  /// surface twice.
  [[nodiscard]] bool holds(const BoundaryVertex& other) const;
  /// Whether another loop lies inside of this one.
  [[nodiscard]] bool surrounds(const Loop& other) const;

 private:
  Base base_;
  std::vector<Eigen::Vector2d> outline_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<std::array<std::uint32_t, 3>> triangles_;
};

/// Whether all of a loop lies along another's rim (kBesideRim).
bool lies_beside(const Loop& loop, const Loop& rim);

// The triangles of an invented closure: a disc within a closed polygon in space, no chord of the polygon in it.

/// Edges grow by this much for each length of distance from the rim.
inline constexpr double kClosureGrading = 0.4;
/// Edges are split and contracted beyond these multiples of the length wanted.
inline constexpr double kLongestEdge = 1.4;
inline constexpr double kShortestEdge = 0.6;

using Points = std::vector<Eigen::Vector3d>;
using Triangles = std::vector<std::array<std::uint32_t, 3>>;

/// By point, the sum of the normals of the triangles around it, each as long as twice the area.
Points normals_around(const Points& points, const Triangles& triangles);

/// Of `points` the first `rim` are the polygon's, in its order; every other one is new.
struct Disc {
  std::size_t rim = 0;
  Points points;
  Triangles triangles;
};

/// Rings of ever fewer vertices around one in the middle. The new vertices have no places yet.
Disc nested_rings(const Points& polygon);

/// Long edges are split, short ones contracted, and edges flipped to Delaunay's, until they are about as long as the
/// rim's beside them, longer ones farther inside. Never joins two vertices of the rim.
void make_even(Disc& disc);

// A boundary loop closed whatever lies around it: for loops around which nothing tells how the surface goes on, in
// meshes that have to be closed all the same, or are those of closed things.

/// A closure that would lie flat across the opening at no more than this angle to the surface around goes on as that
/// does: an opening in something round. From the second angle on it leaves the rim at a right angle to it.
inline constexpr double kGoesOn = 0.52;    // 30 degrees
inline constexpr double kTurnsOff = 1.57;  // 90 degrees
/// A loop whose closure lies, on the average, back over the surface itself (cosine of that angle) is the outer boundary
/// of a sheet, and closed behind it.
inline constexpr double kLiesBack = -0.3;
/// Directions along a rim are means over this share of its edges to either side.
inline constexpr double kRimWindow = 0.02;

struct Closure {
  Filling filling;
  /// Mean cosine, along the rim, of the angle between the flat closure and the surface's continuation: 1 where the
  /// surface goes on into the opening, 0 at the end of a tube, -1 at the outer boundary of a sheet.
  double leads_in = 0;
  /// Of the flat closure, influence radii: twice its area over the rim's length. Of a long one that is how far apart
  /// its sides are, of a round one half of its diameter.
  double width = 0;
};

/// A disc of new vertices and triangles, whatever the loop looks like, so that a mesh whose loops all get theirs is
/// closed and manifold. Every triangle has a new vertex, so that no edge of the mesh is used again. Triangles grow
/// with the distance from the rim. The surface is a membrane over the rim, moved by the displacement of least bending
/// that lets it leave the rim as the constants above say (Botsch and Kobbelt 2004; Jacobson et al. 2010). Depends on
/// the loop alone. Memory: some ten kilobytes for each of its edges.
Closure close_loop(const Loop& loop);

}  // namespace lamina::boundary

// A closed boundary loop's filling: whether the samples around support one, and its triangles.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "boundary/boundary.h"

namespace lamina::boundary {

/// Normals around a gap lie within 75 degrees of their mean (the cosine): beyond, no plane shows the gap without folds.
inline constexpr double kLeastNormalCosine = 0.26;
/// The loop lies this near to one sphere (influence radii R), about as far as the fit itself may err at a boundary.
inline constexpr double kFarthestFromSphere = 0.4;
/// Facets fold by less than 100 degrees (one less the cosine), with each other and with those around.
inline constexpr double kMostFold = 1.17;
/// Loops no longer than this (R), hardly wider than one sample acts, need no sphere: ends of thin things. Facets there
/// fold by less than 140 degrees, which still tells a gap from the outer boundary of a flake.
inline constexpr double kSmallLoop = 5;
inline constexpr double kMostSmallFold = 1.77;
/// Another loop so near to a filling (R) takes its place: the two would be one surface twice.
inline constexpr double kOccupied = 0.5;

enum class Verdict : std::uint8_t {
  filled,
  too_long,        ///< longer than the bound, or of too many edges
  outer_boundary,  ///< the surface lies inside of it
  bent,            ///< normals around it do not agree, or do not belong to one sphere: nothing says what lies between
  occupied,        ///< other boundary loops run through the gap
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

/// The filling of least area, whatever lies around: for boundary loops of which is known that they are none of the
/// thing itself. Around a new vertex in the middle where the mesh has too many of the edges that would be needed. A
/// lone triangle's back is no filling.
Filling fill_any(const Loop& loop);

/// Whether a vertex of another boundary loop lies in the filling, or so near (in R) that the two would be one surface
/// twice.
bool occupies(const BoundaryVertex& other, const Loop& loop, const Filling& filling);

}  // namespace lamina::boundary

// A boundary loop closed whatever lies around it: for loops around which nothing tells how the surface goes on, in
// meshes that have to be closed all the same, or are those of closed things.
#pragma once
#include "boundary/boundary.h"
#include "boundary/fill.h"

namespace lamina::boundary {

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
};

/// A disc of new vertices and triangles, whatever the loop looks like, so that a mesh whose loops all get theirs is
/// closed and manifold. Every triangle has a new vertex, so that no edge of the mesh is used again. Triangles grow
/// with the distance from the rim. The surface is a membrane over the rim, moved by the displacement of least bending
/// that lets it leave the rim as the constants above say (Botsch and Kobbelt 2004; Jacobson et al. 2010). Depends on
/// the loop alone. Memory: some ten kilobytes for each of its edges.
Closure close_loop(const Loop& loop);

}  // namespace lamina::boundary

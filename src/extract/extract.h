// Isosurface extraction from the window, slab by slab: crack-free on the unconstrained octree (METHOD 3.5; the rule of
// docs/method.md "Extraction across levels").
#pragma once
#include <cstdint>

#include "lamina/iso_mesh.h"
#include "window/window.h"

namespace lamina {

struct ExtractSettings {
  /// An isovertex is rejected where a valued end's projected point lies farther than this from the weighted average of
  /// its samples, in units of the local support radius (Adamson & Alexa 2004). 0: no limit.
  float boundary = 0;
};

struct ExtractCounts {
  std::uint64_t crossing_cells = 0;      ///< leaf cells the surface passes through
  std::uint64_t general_cells = 0;       ///< of these, beside a subdivided cell
  std::uint64_t rejected_loops = 0;      ///< loops with an isovertex that is not valid: the rims of open surfaces
  std::uint64_t separated_vertices = 0;  ///< isovertices duplicated so that each is a single fan
};

/// Step 1, numbers: finds the minimal edges with a sign change whose lower end lies in the slab, numbers them and the
/// corners at their ends, and fills slab.corners, slab.corner_attributes and slab.vertices. Signs of the corners in the
/// slab and in the first plane of the next one must be final, and the octree up to the next slab. `previous` (null
/// before the first slab) is the slab below, whose vertical edges end in this one.
void number_edges(Window& window, std::int32_t slab, const ExtractSettings& settings, IsoSlab& out);

/// Step 2, triangles of the slab's leaf cells into slab.triangles; the slab and the next one must be numbered.
/// `next` supplies the positions of vertices the cells share with the next slab.
void triangulate(const Window& window, std::int32_t slab, IsoSlab& out, const IsoSlab& next, ExtractCounts& counts);

/// Step 3: where rejected loops leave a vertex with several fans, gives each fan its own vertex, appended to
/// slab.vertices. Triangles of the slab and of the one below (null before the first) must be known; both are
/// re-indexed.
void separate_fans(IsoSlab* below, IsoSlab& slab, ExtractCounts& counts);

}  // namespace lamina

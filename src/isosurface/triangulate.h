// Isosurface extraction, after number_edges(): triangles, and vertices of their own for separate fans.
#pragma once
#include <cstdint>

#include "isosurface/iso_mesh.h"
#include "octree/window.h"

namespace lamina {

struct ExtractCounts {
  std::uint64_t crossing_cells = 0;      ///< leaf cells the surface passes through
  std::uint64_t general_cells = 0;       ///< of these, beside a subdivided one
  std::uint64_t rejected_loops = 0;      ///< loops with an invalid isovertex, in cells with valid ones: at a boundary
  std::uint64_t separated_vertices = 0;  ///< isovertices doubled so that each is a single fan
};

/// Triangles of the slab's leaf cells into out.triangles, in order of level, tile, cell, loop; the slab and the next
/// one must be numbered, the octree be final up to the next slab. Appends centre vertices to out.vertices; both slabs'
/// IsoVertex::open are brought up to date.
void triangulate(const Window& window, std::int32_t slab, IsoSlab& out, IsoSlab& next, ExtractCounts& counts);

/// After triangulate(slab): where rejected loops leave a vertex with two fans, gives the second a vertex of its own,
/// appended to slab.vertices, a few thousandths of the edge away. Triangles of the slab and of the one below (null
/// before the first) are re-indexed; those below are final then. `above`: numbered; null at the end.
void separate_fans(IsoSlab* below, IsoSlab& slab, const IsoSlab* above, ExtractCounts& counts);

}  // namespace lamina

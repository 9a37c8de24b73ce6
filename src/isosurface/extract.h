// Isosurface extraction from the window, slab by slab: crack-free on the unconstrained octree (Cuccuru et al. 2009,
// section 3.5; the rule of docs/method.md "Extraction across levels").
#pragma once
#include <cstdint>

#include "isosurface/iso_mesh.h"
#include "octree/window.h"

namespace lamina {

struct ExtractCounts {
  std::uint64_t crossing_cells = 0;      ///< leaf cells the surface passes through
  std::uint64_t general_cells = 0;       ///< of these, beside a subdivided one
  std::uint64_t rejected_loops = 0;      ///< loops with an invalid isovertex, in cells with valid ones: at a boundary
  std::uint64_t separated_vertices = 0;  ///< isovertices duplicated so that each is a single fan
};

/// Calls for consecutive slabs go: number_edges(0), number_edges(1), triangulate(0), separate_fans(0), number_edges(2),
/// triangulate(1), separate_fans(1), ...; one empty slab beyond the last is numbered too. Slab s - 1 may leave the
/// window after triangulate(s), and its IsoSlab the hands of the caller after separate_fans(s). Results are the same
/// for any number of threads; the surface is the same for any height of slabs.

/// Step 1, numbers: finds the minimal edges with a sign change whose lower end lies in the slab, numbers those that are
/// valid (both ends have a value, at least one is supported by samples around it) and the corners at their ends, and
/// fills out.corners, out.corner_attributes and out.vertices (what `out` held before is gone, its storage used again).
/// The octree up to this slab, the signs of its corners and
/// of the next one's first plane, and the values of its corners must be final. `previous` (null before the first slab)
/// is the slab below: its vertical edges that end in this slab are completed now (`high`, `t`). Order of vertices:
/// level, tile (z, y, x), layer, axis, place in the layer; of corners: level, tile, layer, place. A corner that several
/// levels hold is listed once, with the finest.
void number_edges(Window& window, std::int32_t slab, IsoSlab* previous, IsoSlab& out);

/// Step 2, triangles of the slab's leaf cells into out.triangles, in order of level, tile, cell, loop; the slab and the
/// next one must be numbered, the octree be final up to the next slab. Appends centre vertices to out.vertices; both
/// slabs' IsoVertex::open are brought up to date.
void triangulate(const Window& window, std::int32_t slab, IsoSlab& out, IsoSlab& next, ExtractCounts& counts);

/// Step 3, after triangulate(slab): where rejected loops leave a vertex with two fans, gives the second its own copy of
/// the vertex, appended to slab.vertices. Triangles of the slab and of the one below (null before the first) are
/// re-indexed; those below are final then.
void separate_fans(IsoSlab* below, IsoSlab& slab, ExtractCounts& counts);

}  // namespace lamina

// From a finished slab's vertex kinds to positions, normals and attributes in the input's coordinates.
#pragma once
#include "clustering/cluster.h"
#include "isosurface/iso_mesh.h"
#include "lamina/frame.h"
#include "meshes/mesh_sink.h"

namespace lamina {

/// `here` is the finished slab, `next` the one above (null at the end). `chord`: SurfaceSettings::chord.
/// A clustered vertex goes to its corner's projected point, moved outward by chord * curvature * cell^2 (at most a
/// quarter of a cell), which makes up for triangles cutting inside a curved surface.
void place_vertices(const FinalSlab& slab, const IsoSlab& here, const IsoSlab* next, const Frame& frame, float chord,
                    VertexBatch& out);

/// Adds an attribute behind those of place_vertices(): the octree level of the finest cell around the vertex's corner,
/// 0 the finest. `finest`: that level's cell, in steps.
void place_levels(const FinalSlab& slab, const IsoSlab& here, const IsoSlab* next, double finest, VertexBatch& out);

/// Adds an attribute behind those that are there: mean curvature of the fit, 1 / input unit. `step`: Frame::step.
void place_curvatures(const FinalSlab& slab, const IsoSlab& here, const IsoSlab* next, double step, VertexBatch& out);

/// The influence radius R that goes with a cell, input units.
struct RadiusRule {
  double per_cell = 1;  ///< for each step of its side
  double least = 0;     ///< whatever the cell
};

/// The influence radius around each vertex, by the finest cell around its corner.
void place_radii(const FinalSlab& slab, const IsoSlab& here, const IsoSlab* next, const RadiusRule& rule,
                 VertexBatch& out);

}  // namespace lamina

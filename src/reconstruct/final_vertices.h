// From a finished slab's vertex kinds to positions, normals and attributes in the input's coordinates.
#pragma once
#include "clustering/clusterer.h"
#include "isosurface/iso_mesh.h"
#include "lamina/frame.h"
#include "meshes/mesh_sink.h"

namespace lamina {

/// The influence radius R that goes with a cell, input units.
struct RadiusRule {
  double per_cell = 1;  ///< for each step of its side
  double least = 0;     ///< whatever the cell
};

/// What vertices are given.
struct VertexSettings {
  float chord = 0.2F;      ///< SurfaceSettings::chord
  bool levels = false;     ///< an attribute behind the samples' own: the octree level of the finest cell around, 0 the
                           ///< finest
  bool curvature = false;  ///< another: mean curvature of the fit, 1 / input unit
  bool filled = false;     ///< another: 0, for those that close holes get 1
  bool invented = false;   ///< another, the last: 0, for those that close what nothing tells how to close get 1
  double finest_cell = 1;  ///< of the lattice, steps
  double trim = 0;         ///< > 0: the mesh is cut where its overhang is this (boundary/rim_trimmer.h)
  bool double_positions = false;  ///< as they are written
  RadiusRule radii;               ///< the influence radius around each vertex, by the finest cell around its corner
};

/// A finished slab with what it refers to.
struct ClusteredSlab {
  const FinalSlab& slab;
  const IsoSlab& here;
  const IsoSlab* next;  ///< the one above, null at the end
};

/// A clustered vertex goes to its corner's projected point, moved outward by chord * curvature * cell^2 (at most a
/// quarter of a cell), which makes up for triangles cutting inside a curved surface.
void place_vertices(const ClusteredSlab& slab, const Frame& frame, const VertexSettings& settings, VertexBatch& out);

}  // namespace lamina

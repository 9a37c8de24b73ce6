// Drawing into one view of the canvas: meshes, edges and points rasterised (draw_primitives.cpp), level sets and fogs
// by rays (draw_level_set.cpp, draw_fog.cpp).
#pragma once
#include <array>
#include <functional>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/mesh.h"
#include "lamina/render.h"
#include "lamina/volume.h"
#include "measure/edge_table.h"
#include "render/canvas.h"
#include "render/view.h"

namespace lamina::render_detail {

/// Unit normals by area-weighted sums of the triangles around each vertex.
std::vector<std::array<float, 3>> vertex_normals(const TriangleMesh& mesh);

/// `normals` has one entry per vertex.
void draw_mesh(const TriangleMesh& mesh, const std::vector<std::array<float, 3>>& normals,
               const RenderSettings& settings, const View& view, Canvas& canvas);

/// Lines over everything drawn before or after.
void draw_edges(const TriangleMesh& mesh, const std::vector<measure::Edge>& edges, const RenderSettings& settings,
                const View& view, Canvas& canvas);

/// `radius` in input units serves points that have none of their own.
void draw_points(const SampleBatch& points, const AttributeLayout& layout, double radius,
                 const RenderSettings& settings, const View& view, Canvas& canvas);

/// World positions of voxels next to the surface.
void visit_surface(const LevelSet& level_set, const std::function<void(const std::array<double, 3>&)>& visit);

/// One ray per sample, by OpenVDB's level set ray intersector; shaded by the distances' gradient.
void draw_level_set(const LevelSet& level_set, const RenderSettings& settings, const View& view, Canvas& canvas);

/// World positions of the fog's voxels.
void visit_fog(const FogVolume& fog, const std::function<void(const std::array<double, 3>&)>& visit);

/// One ray per sample through the fog, by OpenVDB's volume ray intersector; what is behind shines through.
void draw_fog(const FogVolume& fog, const RenderSettings& settings, const View& view, Canvas& canvas);

}  // namespace lamina::render_detail

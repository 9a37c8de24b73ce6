// Drawing one mesh or one batch of points into one view of the canvas.
#pragma once
#include <array>
#include <vector>

#include "lamina/attributes.h"
#include "lamina/mesh.h"
#include "lamina/render.h"
#include "lamina/sample.h"
#include "render/boundary.h"
#include "render/canvas.h"
#include "render/view.h"

namespace lamina::render_detail {

/// Unit normals by area-weighted sums of the triangles around each vertex.
std::vector<std::array<float, 3>> vertex_normals(const TriangleMesh& mesh);

/// `normals` has one entry per vertex.
void draw_mesh(const TriangleMesh& mesh, const std::vector<std::array<float, 3>>& normals,
               const RenderSettings& settings, const View& view, Canvas& canvas);

/// Lines over everything drawn before or after.
void draw_edges(const TriangleMesh& mesh, const std::vector<Edge>& edges, const RenderSettings& settings,
                const View& view, Canvas& canvas);

/// `radius` in input units serves points that have none of their own.
void draw_points(const SampleBatch& points, const AttributeLayout& layout, double radius,
                 const RenderSettings& settings, const View& view, Canvas& canvas);

}  // namespace lamina::render_detail

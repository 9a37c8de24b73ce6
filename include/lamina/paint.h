// Numbers on a surface as colours: distances to the truth, any attribute.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "lamina/mesh.h"
#include "lamina/run.h"

namespace lamina {

/// The values that get the first and the last colour; those beyond get the same.
struct PaintRange {
  double low = 0, high = 1;
};

/// Exact distance from every vertex of `mesh` to the triangles of `truth`, input units. The same for any number of
/// threads. Throws Error(unreadable) when the truth has no triangles.
std::vector<double> vertex_distances(const TriangleMesh& mesh, const TriangleMesh& truth, const RunContext& run = {});

/// From the least value, or 0 where none is negative, to the one that 99 in 100 do not exceed; finite values only.
PaintRange paint_range(std::vector<double> values);

/// The colour of a value, sRGB: dark blue, turquoise, yellow-green, orange, dark red; grey where it is not finite.
std::array<std::uint8_t, 3> paint_colour(double value, const PaintRange& range);

/// Gives every vertex the colour of its value, in place of colours it has. `values` has one entry per vertex.
void paint(TriangleMesh& mesh, const std::vector<double>& values, const PaintRange& range);

}  // namespace lamina

// The part of points or a mesh that lies in a box and before planes, or all but that part.
#pragma once
#include <array>
#include <optional>
#include <vector>

#include "lamina/mesh.h"
#include "lamina/run.h"
#include "lamina/sample.h"

namespace lamina {

/// The half space `dot(normal, p - point) >= 0`.
struct HalfSpace {
  std::array<double, 3> point{};
  std::array<double, 3> normal{0, 0, 1};  ///< any length but 0
};

struct Box {
  std::array<double, 3> low{}, high{};
};

/// Rows that are taken from the input at all; the others are never stored.
struct RowPick {
  std::optional<Box> clip;  ///< faces included; input coordinates
  std::uint64_t every = 1;  ///< >= 1: of so many rows the first
  [[nodiscard]] bool takes_all() const { return !clip && every <= 1; }
};

/// A convex region: the box, faces included, and all half spaces.
struct ClipRegion {
  std::optional<Box> box;
  std::vector<HalfSpace> half_spaces;
};

enum class Keep { inside, outside };

/// True when the point lies in the region; exact for boxes.
bool contains(const ClipRegion& region, const std::array<double, 3>& point);

/// Drops the rows on the wrong side.
void clip_rows(SampleBatch& batch, const ClipRegion& region, Keep keep);

/// Cuts triangles where they cross the region's faces: vertices made on the cut interpolate normals and attributes, and
/// are shared by the triangles on both sides of an edge, so that a manifold mesh stays manifold. The hole is left open.
/// Vertices that no triangle uses any more are dropped; without triangles the vertices are clipped as points.
/// Throws Error(usage) for a region without faces, an empty box, a normal of length 0 or numbers that are not finite.
TriangleMesh clip_mesh(const TriangleMesh& mesh, const ClipRegion& region, Keep keep, const RunContext& run = {});

/// Throws Error(usage) as clip_mesh() does.
void require_sane(const ClipRegion& region);

}  // namespace lamina

// Clipping points and meshes: what lies inside a convex region of a box and half spaces stays, or what lies outside.
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

/// An axis-aligned box, faces included.
struct Box {
  std::array<double, 3> low{}, high{};
};

/// Which rows of an input are read at all; the others are never stored.
struct RowPick {
  std::optional<Box> clip;  ///< faces included; input coordinates
  std::uint64_t every = 1;  ///< >= 1: takes the first of every so many rows
  [[nodiscard]] bool takes_all() const { return !clip && every <= 1; }
};

/// A convex region: the box, faces included, and all half spaces.
struct ClipRegion {
  std::optional<Box> box;
  std::vector<HalfSpace> half_spaces;
};

/// Which side of a region stays.
enum class Keep { inside, outside };

/// True when the point lies in the region. Exact for boxes; for half spaces as exact as one dot product in double.
bool contains(const ClipRegion& region, const std::array<double, 3>& point);

/// Drops the rows of the other side; `keep` says which side stays. The others keep their order.
void clip_rows(SampleBatch& batch, const ClipRegion& region, Keep keep);

/// Cuts triangles where they cross the region's faces. New vertices interpolate normals and attributes, and the
/// triangles on both sides of an edge share them: a manifold mesh stays manifold. The cut is left open. Vertices that
/// no triangle uses any more are dropped; a mesh without triangles is clipped as points. Throws Error(usage) for a
/// region without faces, an empty box, a normal of length 0 or numbers that are not finite.
TriangleMesh clip_mesh(const TriangleMesh& mesh, const ClipRegion& region, Keep keep, const RunContext& run = {});

/// Throws Error(usage) as clip_mesh() does.
void require_sane(const ClipRegion& region);

}  // namespace lamina

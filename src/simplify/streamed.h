// Meshes of any size simplified, region by region from and to the disk; how far that is to go.
#pragma once
#include <cstdint>
#include <functional>
#include <string>

#include "lamina/mesh.h"
#include "lamina/run.h"
#include "lamina/simplify.h"
#include "meshes/formats.h"
#include "meshes/mesh_sink.h"

namespace lamina::simplify {

/// Throws Error(usage) where not one of the three is given, or out of range.
void require_goal(const SimplifySettings& settings);

/// How many triangles are wanted of so many; 0 where a bound says it. Throws Error(usage) for more than there are.
std::uint64_t wanted_triangles(const SimplifySettings& settings, std::uint64_t there);

/// What is left to do for a mesh that a run has made: for more triangles than there are nothing, which is said.
SimplifySettings goal_for(const SimplifySettings& settings, std::uint64_t there, const RunContext& run);

/// A mesh of no more triangles is held in memory; larger ones are cut into regions of no more. Part of what the result
/// is, on any machine.
constexpr std::uint64_t kRegionTriangles = 1'000'000;

/// Memory that a simplification takes, about.
std::uint64_t memory_for(const SimplifySettings& settings, std::uint64_t triangles);

/// Simplifies the mesh, which has normals and attributes or not, and gives the result to `take` piece by piece: its
/// triangles name vertices counted over all pieces. The mesh is read several times. More than
/// `region` triangles are not held at once. Throws as simplify_mesh() does, and
/// Error(budget) for a full disk.
SimplifyStats simplify_blocks(meshes::MeshBlocks& mesh, const SimplifySettings& settings, const std::string& tmp_dir,
                              const std::function<void(TriangleMesh)>& take, const RunContext& run,
                              std::uint64_t region = kRegionTriangles);

/// Where a mesh may wait that is to become `layout`'s files by write_simplified(): never published.
std::string unsimplified_path(const MeshSinkSettings& layout);

/// The same into the files that `layout` names, which appear when they are complete. The mesh has the layout's
/// attributes, and normals.
SimplifyStats write_simplified(meshes::MeshBlocks& mesh, const SimplifySettings& settings,
                               const MeshSinkSettings& layout, const RunContext& run);

}  // namespace lamina::simplify

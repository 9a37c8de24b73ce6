// The formats a mesh is written in, by the ending of its name, and what each of them leaves out.
#pragma once
#include <cstdint>
#include <optional>
#include <string_view>

#include "lamina/run.h"

namespace lamina {

struct MeshSinkSettings;

namespace meshes {

enum class MeshFormat : std::uint8_t { ply, obj, off, stl, glb };

/// How much goes into the files of a GLB.
struct GlbLimits {
  std::uint64_t file = 0xFFFFFFFF;  ///< the GLB's own length has 32 bits
  /// Of each piece where one file does not hold all of a mesh: what programs like to have in one array.
  std::uint64_t buffer = 2'000'000'000;
};

/// By the ending, in any case; nothing for another one.
std::optional<MeshFormat> known_mesh_format(std::string_view path);

/// The same; PLY for every name that says nothing else: "-", pipes, names without an ending.
MeshFormat mesh_format(std::string_view path);

/// Warns of the properties of a mesh that the formats of its names cannot hold, a line for each.
void warn_of_losses(const MeshSinkSettings& mesh, const RunContext& run);

}  // namespace meshes
}  // namespace lamina

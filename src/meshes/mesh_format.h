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

/// By the ending, in any case; nothing for another one.
std::optional<MeshFormat> known_mesh_format(std::string_view path);

/// The same; PLY for every name that says nothing else: "-", pipes, names without an ending.
MeshFormat mesh_format(std::string_view path);

/// Warns of the properties of a mesh that the formats of its names cannot hold, a line for each.
void warn_of_losses(const MeshSinkSettings& mesh, const RunContext& run);

}  // namespace meshes
}  // namespace lamina

// The formats a mesh is written in, by the ending of its name, and what each of them leaves out.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace lamina {

struct MeshSinkSettings;

namespace meshes {

enum class MeshFormat : std::uint8_t { ply, obj, off, stl };

/// By the ending, in any case; nothing for another one.
std::optional<MeshFormat> known_mesh_format(std::string_view path);

/// The same; PLY for every name that says nothing else: "-", pipes, names without an ending.
MeshFormat mesh_format(std::string_view path);

/// One line about the properties of a mesh that the format of its name cannot hold; empty where nothing is lost.
std::string describe_losses(const MeshSinkSettings& mesh);

}  // namespace meshes
}  // namespace lamina

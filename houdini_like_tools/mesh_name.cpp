#include "mesh_name.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <string_view>

#include "lamina/error.h"

namespace lamina::tools {

void require_ply_name(const std::string& output) {
  using namespace std::string_view_literals;
  constexpr std::array kMeshes{".obj"sv, ".off"sv, ".stl"sv};
  constexpr std::array kOthers{".gz"sv,  ".zip"sv,  ".vdb"sv,  ".xyz"sv,  ".csv"sv, ".txt"sv,  ".pts"sv,
                               ".ptx"sv, ".pcd"sv,  ".las"sv,  ".laz"sv,  ".e57"sv, ".gltf"sv, ".glb"sv,
                               ".usd"sv, ".usda"sv, ".usdc"sv, ".usdz"sv, ".fbx"sv, ".abc"sv,  ".dae"sv,
                               ".3mf"sv, ".geo"sv,  ".bgeo"sv, ".vtk"sv,  ".vtp"sv, ".png"sv,  ".json"sv};
  std::string ending = std::filesystem::path(output).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const auto among = [&](const auto& endings) {
    return std::find(endings.begin(), endings.end(), ending) != endings.end();
  };
  if (among(kMeshes))
    throw Error(
        ExitCode::usage,
        fmt::format("{0}: the mesh is written as PLY; name it .ply, or pipe it on: -o - | lamina convert - -o {0}",
                    output));
  if (among(kOthers))
    throw Error(ExitCode::usage, fmt::format("{}: the mesh is written as PLY; name it .ply{}", output,
                                             ending == ".vdb"  ? " (--vdb names the volume beside it)"
                                             : ending == ".gz" ? ", or pipe it on: -o - | gzip"
                                                               : ""));
}

}  // namespace lamina::tools

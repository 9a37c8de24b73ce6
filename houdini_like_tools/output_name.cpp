#include "output_name.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "lamina/error.h"
#include "lamina/file_ending.h"

namespace lamina::tools {
namespace {

using namespace std::string_view_literals;

constexpr std::array kMeshes{".ply"sv, ".obj"sv, ".off"sv, ".stl"sv};
constexpr std::array kOthers{".gz"sv,   ".zip"sv, ".vdb"sv,  ".xyz"sv, ".csv"sv,  ".txt"sv,  ".pts"sv, ".ptx"sv,
                             ".pcd"sv,  ".las"sv, ".laz"sv,  ".e57"sv, ".gltf"sv, ".glb"sv,  ".usd"sv, ".usda"sv,
                             ".usdc"sv, ".fbx"sv, ".usdz"sv, ".abc"sv, ".dae"sv,  ".3mf"sv,  ".geo"sv, ".bgeo"sv,
                             ".vtk"sv,  ".vtp"sv, ".json"sv, ".png"sv, ".jpg"sv,  ".jpeg"sv, ".exr"sv, ".tif"sv,
                             ".tiff"sv, ".bmp"sv, ".gif"sv,  ".svg"sv, ".pdf"sv,  ".webp"sv, ".mp4"sv};

template <class Endings>
bool among(const Endings& endings, std::string_view ending) {
  return std::find(endings.begin(), endings.end(), ending) != endings.end();
}

/// `format` as "a mesh is written as PLY", `hint` what else to do than to name it `wanted`.
void require(const std::string& output, std::string_view wanted, std::string_view format, const std::string& hint) {
  const std::string ending = file_ending(output);
  if (ending == wanted || !(among(kMeshes, ending) || among(kOthers, ending))) return;
  throw Error(ExitCode::usage, fmt::format("{}: {}; name it {}{}", output, format, wanted, hint));
}

}  // namespace

void require_mesh_name(const std::string& output) {
  const std::string ending = file_ending(output);
  const std::string hint = among(kMeshes, ending) ? ", or pipe it on: -o - | lamina convert - -o " + output
                           : ending == ".gz"      ? ", or pipe it on: -o - | gzip"
                           : ending == ".vdb"     ? " (--vdb names the volume beside it)"
                                                  : "";
  require(output, ".ply", "the mesh is written as PLY", hint);
}

void require_volume_name(const std::string& output) {
  require(output, ".vdb", "the volume is written as OpenVDB", "");
}

void require_picture_name(const std::string& output) {
  require(output, ".png", "the picture is written as PNG", "");
}

}  // namespace lamina::tools

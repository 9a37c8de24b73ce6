#include "common/outputs.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <filesystem>
#include <map>
#include <string_view>
#include <system_error>
#include <utility>

#include "common/inputs.h"
#include "common/text.h"
#include "lamina/error.h"
#include "lamina/file_ending.h"

namespace lamina::tools {
namespace {

using namespace std::string_view_literals;

constexpr std::array kMeshes{".ply"sv, ".obj"sv, ".off"sv, ".stl"sv, ".glb"sv};
constexpr std::array kOthers{".gz"sv,  ".zip"sv,  ".vdb"sv, ".xyz"sv, ".csv"sv,  ".txt"sv, ".pts"sv,  ".ptx"sv,
                             ".pcd"sv, ".las"sv,  ".laz"sv, ".e57"sv, ".gltf"sv, ".usd"sv, ".usda"sv, ".usdc"sv,
                             ".fbx"sv, ".usdz"sv, ".abc"sv, ".dae"sv, ".3mf"sv,  ".geo"sv, ".bgeo"sv, ".vtk"sv,
                             ".vtp"sv, ".json"sv, ".png"sv, ".jpg"sv, ".jpeg"sv, ".exr"sv, ".tif"sv,  ".tiff"sv,
                             ".bmp"sv, ".gif"sv,  ".svg"sv, ".pdf"sv, ".webp"sv, ".mp4"sv};

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

void add_files(CLI::App& app, std::string& input, const std::string& input_formats, std::string& output,
               const std::string& output_formats) {
  app.add_option_function<std::string>(
         "INPUT", [&input](const std::string& name) { input = pipe_name(name); },
         input_formats + "; - for PLY on standard input")
      ->required()
      ->type_name("");
  app.add_option_function<std::string>(
         "-o,--output", [&output](const std::string& name) { output = pipe_name(name); },
         output_formats + "; - for PLY on standard output")
      ->required()
      ->type_name("FILE")
      ->group("Output");
}

void add_precision(CLI::App& app, Precision& precision) {
  const std::map<std::string, Precision> words{
      {"auto", Precision::automatic}, {"float", Precision::single_precision}, {"double", Precision::double_precision}};
  app.add_option_function<std::string>(
         "--precision", [&precision, words](const std::string& word) { precision = words.at(word); },
         "Positions as float or double; auto: as in the input, double where float would lose detail [auto]")
      ->check(CLI::IsMember({"auto", "float", "double"}).description(""))
      ->type_name("auto|float|double")
      ->group("Output");
}

PointColumns with_precision(PointColumns columns, Precision precision) {
  if (precision != Precision::automatic) columns.double_positions = precision == Precision::double_precision;
  return columns;
}

std::string volume_text(std::string_view verb, const VolumeEditStats& stats) {
  return fmt::format("{} {} grid{} of {} voxels{}, {}", verb, stats.grids, stats.grids == 1 ? "" : "s",
                     count_text(stats.voxels), stats.points > 0 ? " and " + count_text(stats.points) + " points" : "",
                     bytes_text(stats.bytes));
}

std::string tiles_text(const TileStats& stats) {
  return fmt::format("{} tile{} in {} level{}, {} triangles in the finest, {}{}", stats.tiles,
                     stats.tiles == 1 ? "" : "s", stats.levels, stats.levels == 1 ? "" : "s",
                     count_text(stats.triangles), bytes_text(stats.bytes), stats.on_earth ? ", on the Earth" : "");
}

void require_mesh_name(const std::string& output) {
  const std::string ending = file_ending(output);
  if (among(kMeshes, ending)) return;
  const std::string hint = ending == ".gz"    ? ", or pipe a PLY on: -o - | gzip"
                           : ending == ".vdb" ? " (--vdb names the volume beside it)"
                                              : "";
  require(output, ".ply", "the mesh is written as PLY, OBJ, OFF, STL or GLB", hint);
}

void require_volume_name(const std::string& output) {
  require(output, ".vdb", "the volume is written as OpenVDB", "");
}

void require_picture_name(const std::string& output) {
  require(output, ".png", "the picture is written as PNG", "");
}

ResultFile::ResultFile(std::string path) : path_(std::move(path)) {
  if (path_ == "-") return;
  std::error_code ignored;
  const auto kind = std::filesystem::status(path_, ignored).type();
  if (kind == std::filesystem::file_type::directory) refuse(EISDIR);
  if (kind == std::filesystem::file_type::regular && ::access(path_.c_str(), W_OK) != 0) refuse(errno);
  staged_ = kind == std::filesystem::file_type::regular || kind == std::filesystem::file_type::not_found;
  open();
  if (staged_) discard();
}

ResultFile::~ResultFile() {
  discard();
}

void ResultFile::open() {
  if (staged_) beside_ = fmt::format("{}.partial-{}", path_, ::getpid());
  file_ = std::fopen(staged_ ? beside_.c_str() : path_.c_str(), "w");
  if (file_ == nullptr) refuse(errno);
}

void ResultFile::discard() {
  if (file_ != nullptr) std::fclose(std::exchange(file_, nullptr));
  if (!beside_.empty()) ::unlink(std::exchange(beside_, {}).c_str());
}

void ResultFile::write(const std::string& text) {
  if (staged_) open();
  std::FILE* out = file_ == nullptr ? stdout : file_;
  const bool written = std::fwrite(text.data(), 1, text.size(), out) == text.size() && std::fflush(out) == 0;
  if (!written) refuse(errno);
  if (file_ == nullptr) return;
  if (std::fclose(std::exchange(file_, nullptr)) != 0) refuse(errno);
  if (!staged_) return;
  if (std::rename(beside_.c_str(), path_.c_str()) != 0) refuse(errno);
  beside_.clear();
}

void ResultFile::refuse(int error) const {
  throw Error(ExitCode::budget, fmt::format("{}: cannot be written: {}", path_ == "-" ? "standard output" : path_,
                                            std::generic_category().message(error)));
}

}  // namespace lamina::tools

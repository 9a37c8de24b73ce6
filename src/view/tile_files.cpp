#include "view/tile_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "lamina/error.h"
#include "lamina/file_ending.h"

namespace lamina::view {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 9> kTileEndings{".json", ".glb",  ".gltf", ".bin", ".subtree",
                                                       ".b3dm", ".i3dm", ".pnts", ".cmpt"};

bool is_tile_file(const fs::path& file) {
  const std::string ending = file_ending(file.string());
  return std::find(kTileEndings.begin(), kTileEndings.end(), ending) != kTileEndings.end();
}

/// A page of anything else would only say in the browser that it shows nothing.
void require_tileset(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  constexpr bool kThrows = false;
  const nlohmann::json tileset = nlohmann::json::parse(stream, nullptr, kThrows);
  if (tileset.is_discarded())
    throw Error(ExitCode::unreadable, fmt::format("{}: is no JSON, or only a part of it", file.string()));
  if (!tileset.is_object() || !tileset.contains("asset") || !tileset.contains("root") || !tileset["root"].is_object())
    throw Error(ExitCode::unreadable, fmt::format("{}: is no tile set: it names no asset or no root", file.string()));
}

}  // namespace

std::vector<TileFile> tile_files(const std::string& folder) {
  std::error_code failed;
  const fs::path tileset = fs::path(folder) / "tileset.json";
  if (!fs::is_regular_file(tileset, failed))
    throw Error(ExitCode::unreadable, fmt::format("{}: a folder without a tileset.json", folder));
  require_tileset(tileset);
  std::vector<TileFile> files;
  fs::recursive_directory_iterator entry(folder, failed);
  for (; !failed && entry != fs::recursive_directory_iterator(); entry.increment(failed)) {
    if (entry->is_symlink(failed) || !entry->is_regular_file(failed) || !is_tile_file(entry->path())) continue;
    files.push_back({entry->path().lexically_relative(folder).generic_string(), entry->file_size(failed)});
  }
  if (failed) throw Error(ExitCode::unreadable, fmt::format("{}: {}", folder, failed.message()));
  std::sort(files.begin(), files.end(), [](const TileFile& a, const TileFile& b) { return a.name < b.name; });
  return files;
}

std::optional<std::string> served_file(const std::string& folder, std::string_view name) {
  if (name.find('\0') != std::string_view::npos) return std::nullopt;
  std::error_code failed;
  const fs::path root = fs::canonical(folder, failed);
  if (failed) return std::nullopt;
  const fs::path file = fs::canonical(root / fs::path(name).relative_path(), failed);
  if (failed || !fs::is_regular_file(file, failed)) return std::nullopt;
  const auto [rest, unused] = std::mismatch(root.begin(), root.end(), file.begin(), file.end());
  if (rest != root.end()) return std::nullopt;
  return file.string();
}

std::string media_type(std::string_view name) {
  const std::string ending = file_ending(name);
  if (ending == ".json") return "application/json";
  if (ending == ".glb") return "model/gltf-binary";
  if (ending == ".gltf") return "model/gltf+json";
  return "application/octet-stream";
}

}  // namespace lamina::view

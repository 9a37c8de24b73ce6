// The files of a tile set's folder.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace lamina::view {

struct TileFile {
  std::string name;  ///< from the folder, with slashes
  std::uint64_t bytes = 0;
};

/// Every file of 3D Tiles in the folder and below, by name; links are not followed. Throws Error(unreadable) where
/// there is no tileset.json.
std::vector<TileFile> tile_files(const std::string& folder);

/// The real path of what a server is asked for by `name`, decoded and without its leading slash; nothing for what is no
/// regular file under `folder`, however the name or a link leads out of it.
std::optional<std::string> served_file(const std::string& folder, std::string_view name);

/// The media type by a file's ending.
std::string media_type(std::string_view name);

}  // namespace lamina::view

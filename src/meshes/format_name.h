// What a file's name says it is.
#pragma once
#include <algorithm>
#include <cctype>
#include <filesystem>
#include <string>

namespace lamina::meshes {

/// Extension in lower case with its dot, the one before .gz where there is one.
inline std::string format_name(const std::string& path) {
  std::filesystem::path p(path);
  if (p.extension() == ".gz") p = p.stem();
  std::string e = p.extension().string();
  std::transform(e.begin(), e.end(), e.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return e;
}

}  // namespace lamina::meshes

#include "vdb/sequence.h"

#include <fmt/format.h>

#include <filesystem>

namespace lamina::volume {

std::string numbered(const std::string& path, std::size_t number) {
  const std::filesystem::path p(path);
  const std::string name = fmt::format("{}.{:04}{}", p.stem().string(), number, p.extension().string());
  return (p.parent_path() / name).string();
}

}  // namespace lamina::volume

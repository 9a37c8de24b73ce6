// A GLB read and checked: its JSON, and the numbers of its accessors.
#pragma once
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "meshes/glb.h"
#include "meshes/readers.h"

namespace lamina::meshes {

/// Numbers in rows, wherever they lie in the data.
struct GlbAccessor {
  const std::byte* data = nullptr;
  std::uint64_t count = 0;  ///< rows
  std::size_t stride = 0;   ///< bytes from row to row
  std::size_t width = 1;    ///< numbers in a row
  glb::Component component = glb::kFloat;
  bool normalized = false;

  /// The number in column `k` of a row; normalized ones reach from -1 or 0 to 1.
  [[nodiscard]] double at(std::uint64_t row, std::size_t k) const;
  /// The same as it stands there.
  [[nodiscard]] double raw(std::uint64_t row, std::size_t k) const;
};

class GlbFile {
 public:
  /// Reads all of it, and the files in its folder or below that it says its data lie in. Throws Error(unreadable) for
  /// what is no GLB, is cut short, keeps data elsewhere or needs extensions that change what geometry is.
  GlbFile(FileBuffer& file, std::string path);

  [[nodiscard]] const nlohmann::json& json() const { return json_; }
  /// Within the data. Throws Error(unreadable) where it is not.
  [[nodiscard]] GlbAccessor accessor(std::uint64_t number) const;
  /// Element `number` of a list at the top of the JSON. Throws Error(unreadable) where it is not there.
  [[nodiscard]] const nlohmann::json& element(const char* list, std::uint64_t number) const;
  /// A whole number of an object; `otherwise` where it has none. Throws Error(unreadable) for anything else.
  [[nodiscard]] std::uint64_t whole(const nlohmann::json& object, const char* key, std::uint64_t otherwise) const;
  [[nodiscard]] std::uint64_t whole(const nlohmann::json& object, const char* key) const;
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  [[noreturn]] void fail(const std::string& what) const;

 private:
  std::string take(FileBuffer& file, std::uint64_t bytes);
  std::uint32_t word(FileBuffer& file);
  void require_extensions() const;
  void read_buffers(std::string own);
  [[nodiscard]] std::string read_beside(const std::string& uri, std::uint64_t bytes) const;

  std::string path_;
  std::vector<std::string> buffers_;
  nlohmann::json json_;
  std::uint64_t bytes_ = 0;  ///< read
};

}  // namespace lamina::meshes

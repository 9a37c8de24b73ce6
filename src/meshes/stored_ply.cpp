#include "meshes/stored_ply.h"

#include <fcntl.h>
#include <sys/stat.h>

#include <array>
#include <cstddef>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <utility>

#include "meshes/file_stream.h"
#include "meshes/streamed_ply.h"
#include "points/ply_header.h"

namespace lamina::meshes {
namespace {

/// The header of a PLY that is a file by itself and not compressed.
std::optional<PlyHeader> header_of(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return std::nullopt;
  FileBuffer file(path);
  std::array<char, 4> magic{};
  if (file.sgetn(magic.data(), magic.size()) != magic.size()) return std::nullopt;
  const std::string_view begin(magic.data(), magic.size());
  if (file.compressed() || (begin != "ply\n" && begin != "ply\r")) return std::nullopt;
  file.pubseekpos(0);
  return read_ply_header(file, path);
}

bool has_fixed_rows(const PlyElement& vertices) {
  constexpr std::array<std::string_view, 6> kFirst{"x", "y", "z", "nx", "ny", "nz"};
  if (vertices.name != "vertex" || vertices.properties.size() < kFirst.size() || vertices.has_list()) return false;
  const ScalarType position = vertices.properties[0].type;
  if (position != ScalarType::float32 && position != ScalarType::float64) return false;
  for (std::size_t i = 0; i < kFirst.size(); ++i) {
    if (vertices.properties[i].name != kFirst[i]) return false;
    if (vertices.properties[i].type != (i < 3 ? position : ScalarType::float32)) return false;
  }
  return true;
}

bool has_triangle_rows(const PlyElement& faces) {
  if (faces.name != "face" || faces.properties.size() != 1) return false;
  const PlyProperty& list = faces.properties[0];
  return (list.name == "vertex_indices" || list.name == "vertex_index") && list.list_count == ScalarType::uint8 &&
         (list.type == ScalarType::int32 || list.type == ScalarType::uint32);
}

}  // namespace

std::optional<StoredPly> open_stored_ply(const std::string& path) {
  const std::optional<PlyHeader> header = header_of(path);
  if (!header || header->format != PlyFormat::little_endian || header->elements.size() != 2 ||
      !has_fixed_rows(header->elements[0]) || !has_triangle_rows(header->elements[1]))
    return std::nullopt;
  const PlyElement& vertices = header->elements[0];
  StoredPly ply;
  ply.layout.path = path;
  ply.layout.double_positions = vertices.properties[0].type == ScalarType::float64;
  for (std::size_t i = 6; i < vertices.properties.size(); ++i)
    ply.layout.attributes.push_back({vertices.properties[i].name, vertices.properties[i].type});
  const std::uint64_t row = vertices.row_bytes();
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  constexpr std::uint64_t kMost = 0xFFFFFFFF;
  if (error || vertices.count > kMost || header->elements[1].count > size / kFaceRecordBytes ||
      size != header->bytes + row * vertices.count + kFaceRecordBytes * header->elements[1].count)
    return std::nullopt;
  ply.file = Descriptor(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!ply.file) return std::nullopt;
  ply.mesh = {ply.file.get(), header->bytes,
              ply.file.get(), header->bytes + row * vertices.count,
              vertices.count, header->elements[1].count};
  return ply;
}

std::string crs_of_ply(const std::string& path) {
  const std::optional<PlyHeader> header = header_of(path);
  return header ? header->crs : std::string();
}

}  // namespace lamina::meshes

#include "meshes/stored_mesh.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "base/descriptor.h"
#include "base/number.h"
#include "base/output_file.h"
#include "lamina/error.h"
#include "meshes/formats.h"
#include "meshes/mesh_sink.h"
#include "points/ply_header.h"

namespace lamina {
namespace {

/// Decodes what encode_vertices() and encode_faces() have written.
class StoredBlocks final : public meshes::MeshBlocks {
 public:
  StoredBlocks(const StoredMesh& mesh, const MeshSinkSettings& settings, std::string path, const RunContext& run)
      : mesh_(mesh),
        settings_(settings),
        path_(std::move(path)),
        run_(run),
        record_(vertex_record_bytes(settings.attributes, settings.double_positions)) {}

  [[nodiscard]] std::uint64_t vertices() const override { return mesh_.vertices; }
  [[nodiscard]] std::uint64_t triangles() const override { return mesh_.triangles; }
  [[nodiscard]] bool has_normals() const override { return true; }
  [[nodiscard]] const AttributeLayout& layout() const override { return settings_.attributes; }
  [[nodiscard]] std::vector<std::string> comments() const override {
    std::vector<std::string> lines{sink_signature()};
    lines.insert(lines.end(), settings_.comments.begin(), settings_.comments.end());
    return lines;
  }

  void read_vertices(std::uint64_t first, std::size_t count, TriangleMesh& out) override {
    read(mesh_.vertex_file, mesh_.vertex_offset + first * record_, count * record_);
    out.positions.resize(count);
    out.normals.resize(count);
    out.attributes.resize(settings_.attributes.size());
    for (std::vector<float>& column : out.attributes) column.resize(count);
    const std::byte* from = bytes_.data();
    for (std::size_t v = 0; v < count; ++v) {
      for (double& c : out.positions[v])
        c = settings_.double_positions ? take<double>(from) : static_cast<double>(take<float>(from));
      for (float& c : out.normals[v]) c = take<float>(from);
      for (std::size_t a = 0; a < out.attributes.size(); ++a) {
        with_scalar_type(settings_.attributes[a].type,
                         [&](auto zero) { out.attributes[a][v] = static_cast<float>(take<decltype(zero)>(from)); });
      }
    }
  }

  /// The records as they are, behind a header of their own: another PLY.
  void copy_to(ResultFile& out) {
    out.write(mesh_header(settings_, mesh_.vertices, mesh_.triangles));
    copy(mesh_.vertex_file, mesh_.vertex_offset, mesh_.vertices * record_, out);
    copy(mesh_.face_file, mesh_.face_offset, mesh_.triangles * kFaceRecordBytes, out);
  }

  void read_triangles(std::uint64_t first, std::size_t count, std::vector<std::array<std::uint32_t, 3>>& out) override {
    read(mesh_.face_file, mesh_.face_offset + first * kFaceRecordBytes, count * kFaceRecordBytes);
    out.resize(count);
    const std::byte* from = bytes_.data();
    for (auto& triangle : out) {
      if (const auto corners = take<std::uint8_t>(from); corners != 3)
        throw Error(ExitCode::unreadable,
                    fmt::format("{}: a face has {} corners, where only triangles are", path_, corners));
      for (std::uint32_t& v : triangle) v = take<std::uint32_t>(from);
    }
  }

 private:
  template <class T>
  static T take(const std::byte*& from) {
    const T value = load_little<T>(from);
    from += sizeof(T);
    return value;
  }

  void copy(int file, std::uint64_t offset, std::uint64_t bytes, ResultFile& out) {
    constexpr std::uint64_t kPiece = std::uint64_t{1} << 20;
    for (std::uint64_t done = 0; done < bytes; done += kPiece) {
      read(file, offset + done, std::min(kPiece, bytes - done));
      out.write({reinterpret_cast<const char*>(bytes_.data()), bytes_.size()});
    }
  }

  void read(int file, std::uint64_t offset, std::size_t bytes) {
    if (run_.cancelled()) throw Error(ExitCode::internal, "cancelled");
    bytes_.resize(bytes);
    const ReadResult got = pread_all(file, bytes_.data(), bytes, offset);
    if (got.error != 0 || got.bytes < bytes) {
      throw Error(ExitCode::budget,
                  fmt::format("{}: its temporary mesh cannot be read back: {}", path_,
                              got.error != 0 ? system_message(got.error) : std::string("it is too short")));
    }
  }

  const StoredMesh& mesh_;
  const MeshSinkSettings& settings_;
  std::string path_;
  const RunContext& run_;
  std::size_t record_;
  std::vector<std::byte> bytes_;
};

void write_stored(const StoredMesh& mesh, const MeshSinkSettings& settings, const std::string& path,
                  const RunContext& run) {
  ResultFile out(path, settings.tmp_dir);
  StoredBlocks blocks(mesh, settings, path, run);
  if (meshes::mesh_format(path) == meshes::MeshFormat::ply) {
    blocks.copy_to(out);
  } else {
    meshes::write_blocks(blocks, meshes::mesh_format(path), out, settings.glb);
  }
  out.commit();
}

bool is_ply_name(const std::string& path) {
  return meshes::mesh_format(path) == meshes::MeshFormat::ply;
}

/// The names but the staged one.
std::vector<std::string> other_paths(const MeshSinkSettings& settings) {
  std::vector<std::string> others = settings.paths();
  others.erase(std::find(others.begin(), others.end(), staging_path(settings)));
  return others;
}

}  // namespace

const std::string& staging_path(const MeshSinkSettings& settings) {
  if (is_ply_name(settings.path)) return settings.path;
  const auto ply = std::find_if(settings.more_paths.begin(), settings.more_paths.end(), is_ply_name);
  return ply == settings.more_paths.end() ? settings.path : *ply;
}

void require_outputs(const MeshSinkSettings& settings) {
  for (const std::string& path : other_paths(settings)) const OutputFile trial(path, settings.tmp_dir);
}

std::unique_ptr<meshes::MeshBlocks> stored_blocks(const StoredMesh& mesh, const MeshSinkSettings& settings,
                                                  const RunContext& run) {
  return std::make_unique<StoredBlocks>(mesh, settings, settings.path, run);
}

void write_files(const StoredMesh& mesh, const MeshSinkSettings& settings, const std::function<void()>& publish,
                 const RunContext& run) {
  std::optional<Error> first;
  const auto attempt = [&](const auto& write) {
    try {
      write();
    } catch (const Error& error) {
      if (run.cancelled()) throw;
      if (first) run.warn(error.what());
      if (!first) first = error;
    }
  };
  const std::string& staged = staging_path(settings);
  std::vector<std::string> paths = other_paths(settings);
  if (!is_ply_name(staged)) paths.insert(paths.begin(), staged);
  for (const std::string& path : paths) attempt([&] { write_stored(mesh, settings, path, run); });
  if (is_ply_name(staged)) attempt(publish);
  if (first) throw Error(*first);
}

}  // namespace lamina

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

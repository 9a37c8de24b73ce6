#include "meshes/stored_mesh.h"

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/descriptor.h"
#include "base/little_endian.h"
#include "base/output_file.h"
#include "base/scalar_type.h"
#include "lamina/error.h"
#include "meshes/mesh_format.h"
#include "meshes/streamed_ply.h"
#include "meshes/writers.h"

namespace lamina {
namespace {

/// Decodes what encode_vertices() and encode_faces() have written.
class StoredBlocks final : public meshes::MeshBlocks {
 public:
  StoredBlocks(const StoredMesh& mesh, const MeshSinkSettings& settings, const RunContext& run)
      : mesh_(mesh),
        settings_(settings),
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

  void read_triangles(std::uint64_t first, std::size_t count, std::vector<std::array<std::uint32_t, 3>>& out) override {
    read(mesh_.face_file, mesh_.face_offset + first * kFaceRecordBytes, count * kFaceRecordBytes);
    out.resize(count);
    const std::byte* from = bytes_.data();
    for (auto& triangle : out) {
      ++from;  // how many there are: three
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

  void read(int file, std::uint64_t offset, std::size_t bytes) {
    if (run_.cancelled()) throw Error(ExitCode::internal, "cancelled");
    bytes_.resize(bytes);
    const ReadResult got = pread_all(file, bytes_.data(), bytes, offset);
    if (got.error != 0 || got.bytes < bytes) {
      throw Error(ExitCode::budget,
                  fmt::format("{}: its temporary mesh cannot be read back: {}", settings_.path,
                              got.error != 0 ? system_message(got.error) : std::string("it is too short")));
    }
  }

  const StoredMesh& mesh_;
  const MeshSinkSettings& settings_;
  const RunContext& run_;
  std::size_t record_;
  std::vector<std::byte> bytes_;
};

}  // namespace

void write_stored(const StoredMesh& mesh, const MeshSinkSettings& settings, const RunContext& run) {
  ResultFile out(settings.path, settings.tmp_dir);
  StoredBlocks blocks(mesh, settings, run);
  meshes::write_blocks(blocks, meshes::mesh_format(settings.path), out);
  out.commit();
}

}  // namespace lamina

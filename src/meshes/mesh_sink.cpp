#include "meshes/mesh_sink.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "base/background_writer.h"
#include "base/descriptor.h"
#include "base/output_file.h"
#include "lamina/error.h"
#include "lamina/mesh_receiver.h"
#include "meshes/stored_mesh.h"
#include "meshes/streamed_ply.h"
#include "meshes/writers.h"

namespace lamina {
namespace {

constexpr std::size_t kBuffers = 6;  ///< on their way to the disk

MeshSinkSettings checked(MeshSinkSettings settings) {
  require_ply_names(settings.attributes);
  require_outputs(settings);
  return settings;
}

}  // namespace

std::vector<std::string> MeshSinkSettings::paths() const {
  std::vector<std::string> all{path};
  all.insert(all.end(), more_paths.begin(), more_paths.end());
  return all;
}

struct MeshSink::Impl {
  explicit Impl(MeshSinkSettings s)
      : settings(checked(std::move(s))),
        output(staging_path(settings), settings.tmp_dir),
        face_directory(settings.tmp_dir.empty() ? output.directory() : settings.tmp_dir),
        face_file(open_unlinked(face_directory)),
        writer(buffer_bytes(settings), kBuffers),
        vertex_writer(writer, vertex_record_bytes(settings.attributes, settings.double_positions)),
        face_writer(writer, kFaceRecordBytes) {
    const std::string reserved(mesh_header_bytes(settings), ' ');
    check_vertices(write_all(output.fd(), reserved.data(), reserved.size()));
  }

  /// Of which a vertex with very many attributes needs more.
  static std::size_t buffer_bytes(const MeshSinkSettings& s) {
    return std::max(RecordWriter::kBytes, vertex_record_bytes(s.attributes, s.double_positions));
  }
  void check_vertices(int error) const {
    if (error != 0) report_write_error(output.name(), error);
  }
  /// What the background says may be about either file.
  void check_written(int error) {
    if (error == 0) return;
    if (writer.failed_file() != face_file.get()) check_vertices(error);
    report_write_error(fmt::format("{}: the temporary face file ({} bytes)", face_directory, face_writer.written()),
                       error);
  }
  void require_open() const {
    if (committed) throw Error(ExitCode::internal, output.name() + ": is committed, nothing can be added");
  }

  /// A vertex that never came would make a file no program can read.
  void require_indices() const {
    if (triangles > 0 && largest_index >= vertices) {
      throw Error(ExitCode::internal, fmt::format("{}: a triangle uses vertex {}, the mesh has {} vertices",
                                                  output.name(), largest_index, vertices));
    }
  }

  /// All of it in the files.
  StoredMesh stored() {
    check_written(vertex_writer.flush(output.fd()));
    check_written(face_writer.flush(face_file.get()));
    check_written(writer.drain());
    return {output.fd(), mesh_header_bytes(settings), face_file.get(), 0, vertices, triangles};
  }

  void commit(const RunContext& run) {
    require_open();
    require_indices();
    const StoredMesh mesh = stored();
    write_files(
        mesh, settings, [this] { publish(); }, run);
    committed = true;
  }

  /// The vertices' file becomes the PLY it was made for.
  void publish() {
    const std::string header = mesh_header(settings, vertices, triangles);
    check_vertices(pwrite_all(output.fd(), header.data(), header.size(), 0));
    if (output.streams()) {
      Descriptor to = output.destination();
      check_vertices(copy_all(output.fd(), header.size() + vertex_writer.written(), to.get()));
      check_vertices(copy_all(face_file.get(), face_writer.written(), to.get()));
      check_vertices(to.close());
    } else {
      check_vertices(move_all(face_file.get(), face_writer.written(), output.fd()));
      output.publish();
    }
  }

  MeshSinkSettings settings;
  OutputFile output;
  std::string face_directory;
  Descriptor face_file;
  BackgroundWriter writer;
  RecordWriter vertex_writer, face_writer;
  std::uint64_t vertices = 0, triangles = 0;
  std::uint32_t largest_index = 0;
  bool committed = false;
};

MeshSink::MeshSink(MeshSinkSettings settings) : impl_(std::make_unique<Impl>(std::move(settings))) {}
MeshSink::~MeshSink() = default;

void MeshSink::append_vertices(const VertexBatch& batch) {
  Impl& s = *impl_;
  s.require_open();
  const AttributeLayout& attributes = s.settings.attributes;
  const bool wide = s.settings.double_positions;
  require_writable(batch, attributes, wide, s.vertices);
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (s.vertices + batch.size() > kMost) {
    throw Error(ExitCode::budget,
                fmt::format("{}: the mesh has more than {} vertices, the most 32-bit indices can name; "
                            "use a larger cell or cut the cloud",
                            s.output.name(), kMost));
  }
  s.check_written(
      s.vertex_writer.append(s.output.fd(), batch.size(), [&](std::byte* to, std::size_t first, std::size_t n) {
        encode_vertices(batch, attributes, wide, first, n, to);
      }));
  s.vertices += batch.size();
}

void MeshSink::append_triangles(const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  Impl& s = *impl_;
  s.require_open();
  s.check_written(
      s.face_writer.append(s.face_file.get(), triangles.size(), [&](std::byte* to, std::size_t first, std::size_t n) {
        s.largest_index = std::max(s.largest_index, encode_faces(triangles.data() + first, n, to));
      }));
  s.triangles += triangles.size();
}

std::uint64_t MeshSink::vertices() const {
  return impl_->vertices;
}
std::uint64_t MeshSink::triangles() const {
  return impl_->triangles;
}
const std::string& MeshSink::tmp_dir() const {
  return impl_->face_directory;
}
void MeshSink::read_back(const std::function<void(meshes::MeshBlocks&)>& use, const RunContext& run) {
  impl_->require_open();
  impl_->require_indices();
  const StoredMesh mesh = impl_->stored();
  use(*stored_blocks(mesh, impl_->settings, run));
}
void MeshSink::commit(const RunContext& run) {
  impl_->commit(run);
}

namespace {

constexpr std::size_t kVerticesAtOnce = 1U << 14;

}  // namespace

void take_vertices(const TriangleMesh& mesh, std::size_t first, std::size_t count, VertexBatch& out) {
  out.x.resize(count), out.y.resize(count), out.z.resize(count);
  out.nx.resize(count), out.ny.resize(count), out.nz.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto& p = mesh.positions[first + i];
    out.x[i] = p[0], out.y[i] = p[1], out.z[i] = p[2];
    const auto& n = mesh.normals[first + i];
    out.nx[i] = n[0], out.ny[i] = n[1], out.nz[i] = n[2];
  }
  out.attributes.resize(mesh.attributes.size());
  for (std::size_t a = 0; a < mesh.attributes.size(); ++a) {
    const auto begin = mesh.attributes[a].begin() + static_cast<std::ptrdiff_t>(first);
    out.attributes[a].assign(begin, begin + static_cast<std::ptrdiff_t>(count));
  }
}

void append_mesh(const TriangleMesh& mesh, MeshSink& sink) {
  VertexBatch batch;
  for (std::size_t first = 0; first < mesh.positions.size(); first += kVerticesAtOnce) {
    take_vertices(mesh, first, std::min(kVerticesAtOnce, mesh.positions.size() - first), batch);
    sink.append_vertices(batch);
  }
  sink.append_triangles(mesh.triangles);
}

void write_mesh(const TriangleMesh& mesh, const StreamedMeshLayout& layout, const std::string& path,
                const RunContext& run) {
  if (mesh.layout != layout.attributes || mesh.normals.size() != mesh.positions.size())
    throw Error(ExitCode::internal, path + ": the mesh is not of the layout that it is to be written in");
  const MeshSinkSettings settings{.path = path,
                                  .tmp_dir = run.tmp_dir,
                                  .attributes = layout.attributes,
                                  .double_positions = layout.double_positions,
                                  .comments = layout.comments};
  meshes::warn_of_losses(settings, run);
  MeshSink sink(settings);
  append_mesh(mesh, sink);
  sink.commit(run);
}

}  // namespace lamina

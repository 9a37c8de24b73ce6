#include "meshes/mesh_sink.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/descriptor.h"
#include "base/number.h"
#include "base/output_file.h"
#include "base/spill_file.h"
#include "lamina/error.h"
#include "lamina/mesh_receiver.h"
#include "meshes/formats.h"
#include "meshes/stored_mesh.h"
#include "points/ply_header.h"

namespace lamina {
namespace {

constexpr std::string_view kPaddingStart = "comment ";

/// The header with `padding` characters of a last comment; that line is there even when they are none.
std::string header_text(const MeshSinkSettings& settings, std::uint64_t vertices, std::uint64_t triangles,
                        std::string_view index_type, std::size_t padding) {
  std::string text = fmt::format("ply\nformat binary_little_endian 1.0\ncomment {}\n", sink_signature());
  for (const std::string& comment : settings.comments) text += ply_comment(comment);
  text += fmt::format("element vertex {}\n", vertices);
  const std::string_view position = settings.double_positions ? "double" : "float";
  for (const char* axis : {"x", "y", "z"}) text += fmt::format("property {} {}\n", position, axis);
  for (const char* axis : {"nx", "ny", "nz"}) text += fmt::format("property float {}\n", axis);
  for (const AttributeSpec& attribute : settings.attributes) {
    text += fmt::format("property {} {}\n", ply_name(attribute.type), attribute.name);
  }
  text += fmt::format("element face {}\nproperty list uchar {} vertex_indices\n", triangles, index_type);
  return text + std::string(kPaddingStart) + std::string(padding, '-') + "\nend_header\n";
}

constexpr std::string_view kMadeBy = "made by lamina ";

/// Vertices encoded column by column at once: the records stay in the first-level cache across the columns.
constexpr std::size_t kBlock = 256;

/// Does any of the values become infinite or NaN when written as T? Looks at the exponent bits, so that it vectorises.
template <class T, class In>
bool any_not_finite(const std::vector<In>& values) {
  using Bits = std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>;
  constexpr Bits kExponent = std::bit_cast<Bits>(std::numeric_limits<T>::infinity());
  Bits bad = 0;
  for (const In value : values) {
    const Bits bits = std::bit_cast<Bits>(static_cast<T>(value)) & kExponent;
    bad |= static_cast<Bits>(bits == kExponent);
  }
  return bad != 0;
}

template <class T, class In>
void require_finite(const std::vector<In>& values, std::string_view name, std::uint64_t first) {
  if (!any_not_finite<T>(values)) return;
  const auto at = std::find_if(values.begin(), values.end(), [](In v) { return !std::isfinite(static_cast<T>(v)); });
  throw Error(ExitCode::internal, fmt::format("vertex {} of the mesh would get {} = {}, which a mesh must not hold",
                                              first + static_cast<std::uint64_t>(at - values.begin()), name, *at));
}

template <class T, class In>
std::byte* put_column(const In* values, std::size_t count, std::size_t stride, std::byte* out) {
  std::byte* to = out;
  for (std::size_t i = 0; i < count; ++i, to += stride) store_little(to, to_scalar<T>(values[i]));
  return out + sizeof(T);
}

std::byte* put_attribute_column(ScalarType type, const float* values, std::size_t count, std::size_t stride,
                                std::byte* out) {
  return with_scalar_type(type, [&](auto zero) { return put_column<decltype(zero)>(values, count, stride, out); });
}

}  // namespace

void require_ply_names(const AttributeLayout& attributes) {
  std::vector<std::string_view> names;
  for (const AttributeSpec& attribute : attributes) names.push_back(attribute.name);
  require_ply_names("attribute", names);
}

std::size_t mesh_header_bytes(const MeshSinkSettings& settings) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint64_t>::max();
  return header_text(settings, kMost, kMost, "uint", 0).size();
}

std::string mesh_header(const MeshSinkSettings& settings, std::uint64_t vertices, std::uint64_t triangles) {
  constexpr std::uint64_t kMostSigned = std::numeric_limits<std::int32_t>::max();
  const std::string_view index_type = vertices > kMostSigned ? "uint" : "int";
  const std::size_t bare = header_text(settings, vertices, triangles, index_type, 0).size();
  return header_text(settings, vertices, triangles, index_type, mesh_header_bytes(settings) - bare);
}

std::string sink_signature() {
  return std::string(kMadeBy) + LAMINA_VERSION;
}

std::optional<std::string> read_sink_signature(const std::string& path) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  std::array<char, 512> start{};  // it is the header's first comment
  ReadResult got{0, errno};
  if (file) got = pread_all(file.get(), start.data(), start.size(), 0);
  if (got.error != 0) {
    throw Error(ExitCode::unreadable, fmt::format("{}: cannot be read: {}", path, system_message(got.error)));
  }
  const std::string_view text(start.data(), got.bytes);
  const std::string line = "\ncomment " + std::string(kMadeBy);
  const std::size_t at = text.find(line);
  if (!text.starts_with("ply\n") || at == std::string_view::npos) return std::nullopt;
  const std::size_t begin = at + line.size();
  const std::size_t end = text.find('\n', begin);
  if (end == std::string_view::npos) return std::nullopt;
  return std::string(text.substr(begin, end - begin));
}

std::size_t vertex_record_bytes(const AttributeLayout& attributes, bool double_positions) {
  std::size_t bytes = 3 * (double_positions ? sizeof(double) : sizeof(float)) + 3 * sizeof(float);
  for (const AttributeSpec& attribute : attributes) bytes += static_cast<std::size_t>(byte_size(attribute.type));
  return bytes;
}

void require_writable(const VertexBatch& batch, const AttributeLayout& attributes, bool double_positions,
                      std::uint64_t first) {
  const std::size_t n = batch.size();
  bool even = batch.attributes.size() == attributes.size();
  for (const auto* axis : {&batch.y, &batch.z}) even = even && axis->size() == n;
  for (const auto* normal : {&batch.nx, &batch.ny, &batch.nz}) even = even && normal->size() == n;
  for (const auto& attribute : batch.attributes) even = even && attribute.size() == n;
  if (!even) throw Error(ExitCode::internal, "the arrays of a batch of vertices differ in length");

  const auto position = [&](const std::vector<double>& values, std::string_view name) {
    double_positions ? require_finite<double>(values, name, first) : require_finite<float>(values, name, first);
  };
  position(batch.x, "x");
  position(batch.y, "y");
  position(batch.z, "z");
  require_finite<float>(batch.nx, "nx", first);
  require_finite<float>(batch.ny, "ny", first);
  require_finite<float>(batch.nz, "nz", first);
  for (std::size_t a = 0; a < attributes.size(); ++a) {
    require_finite<float>(batch.attributes[a], attributes[a].name, first);
  }
}

void encode_vertices(const VertexBatch& batch, const AttributeLayout& attributes, bool double_positions,
                     std::size_t first, std::size_t count, std::byte* out) {
  const std::size_t stride = vertex_record_bytes(attributes, double_positions);
  for (std::size_t done = 0; done < count; done += kBlock) {
    const std::size_t n = std::min(kBlock, count - done);
    const std::size_t at = first + done;
    std::byte* to = out + done * stride;
    for (const auto* axis : {&batch.x, &batch.y, &batch.z}) {
      to = double_positions ? put_column<double>(axis->data() + at, n, stride, to)
                            : put_column<float>(axis->data() + at, n, stride, to);
    }
    for (const auto* normal : {&batch.nx, &batch.ny, &batch.nz}) {
      to = put_column<float>(normal->data() + at, n, stride, to);
    }
    for (std::size_t a = 0; a < attributes.size(); ++a) {
      to = put_attribute_column(attributes[a].type, batch.attributes[a].data() + at, n, stride, to);
    }
  }
}

std::uint32_t encode_faces(const std::array<std::uint32_t, 3>* triangles, std::size_t count, std::byte* out) {
  std::uint32_t largest = 0;
  for (std::size_t i = 0; i < count; ++i, out += kFaceRecordBytes) {
    const auto& triangle = triangles[i];
    out[0] = std::byte{3};
    std::memcpy(out + 1, triangle.data(), sizeof triangle);
    largest = std::max({largest, triangle[0], triangle[1], triangle[2]});
  }
  return largest;
}

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

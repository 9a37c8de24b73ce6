#include "meshes/streamed_ply.h"

#include <fcntl.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <string_view>
#include <type_traits>
#include <vector>

#include "base/descriptor.h"
#include "base/little_endian.h"
#include "base/scalar_type.h"
#include "lamina/error.h"
#include "meshes/mesh_sink.h"
#include "points/ply_header.h"

namespace lamina {
namespace {

constexpr std::string_view kPaddingStart = "comment ";

/// The header with `padding` characters of a last comment; that line is there even when they are none.
std::string header_text(const MeshSinkSettings& settings, std::uint64_t vertices, std::uint64_t triangles,
                        std::string_view index_type, std::size_t padding) {
  std::string text = fmt::format("ply\nformat binary_little_endian 1.0\ncomment {}\n", sink_signature());
  for (const std::string& comment : settings.comments) text += fmt::format("comment {}\n", one_line(comment));
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

}  // namespace lamina

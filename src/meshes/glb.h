// What the writer and the reader of GLB (binary glTF 2.0) share: the container's words, the types
// of its numbers, and how a mesh lies that is too large for one; a file read and checked.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/number.h"
#include "base/output_file.h"
#include "lamina/attributes.h"
#include "lamina/mesh.h"
#include "meshes/formats.h"

namespace lamina::meshes::glb {

inline constexpr std::uint32_t kMagic = 0x46546C67;      ///< "glTF"
inline constexpr std::uint32_t kJsonChunk = 0x4E4F534A;  ///< "JSON"
inline constexpr std::uint32_t kDataChunk = 0x004E4942;  ///< "BIN"
inline constexpr std::uint32_t kVersion = 2;
inline constexpr std::size_t kHeaderBytes = 12;
inline constexpr std::size_t kChunkHeaderBytes = 8;

/// The numbers of an accessor.
enum Component : std::uint32_t { kByte = 5120, kUbyte, kShort, kUshort, kUint = 5125, kFloat = 5126 };

/// glTF allows no whole numbers of 32 bits for vertices, and no doubles: those are floats, as they are in memory.
inline Component component_of(ScalarType type) {
  switch (type) {
    case ScalarType::int8:
      return kByte;
    case ScalarType::uint8:
      return kUbyte;
    case ScalarType::int16:
      return kShort;
    case ScalarType::uint16:
      return kUshort;
    default:
      return kFloat;
  }
}

/// The semantic of an attribute that glTF knows nothing of: "_CURVATURE" of "curvature".
inline std::string semantic_of(std::string_view attribute) {
  std::string semantic = "_";
  for (const char c : attribute) semantic += c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  return semantic;
}

}  // namespace lamina::meshes::glb

namespace lamina::meshes {

/// A mesh that is too large for one GLB: its first piece in the GLB, the others in files beside it. The triangles in
/// their order, a primitive for each buffer with vertices of its own, some of which others have as well: which of the
/// mesh's they are is noted, so that reading makes it one again. Files are named NAME.1.SUM.bin by what is in them, so
/// that those of an older mesh stay until the new GLB has replaced the one that names them. Keeps two bits for each
/// vertex of the mesh, and blocks. Throws Error(budget) where `out` is a pipe or device; else as write_glb() does.
void write_glb_set(MeshBlocks& mesh, ResultFile& out, const GlbLimits& limits);

/// The files with such names that the GLB at `path` says its data lie in; none where it is no GLB of that kind.
std::vector<std::string> companions_of_glb(const std::string& path);

/// A file's name as a relative URI, and back; nothing where it would lead out of the folder or to another place.
std::string uri_of_file(const std::string& name);
std::optional<std::string> file_of_uri(const std::string& uri);

// A GLB as it is written: what it holds of each vertex, its JSON, and its bytes on their way to the file.

using GlbJson = nlohmann::ordered_json;

constexpr std::size_t kMostGlbColumn = 16;  ///< bytes of a vertex in one

/// One accessor of the vertices, in a buffer view of its own.
struct GlbColumn {
  std::string semantic;
  GlbJson accessor;        ///< without what all of them have
  std::size_t stride = 0;  ///< bytes of a vertex, a multiple of 4
  std::function<void(const TriangleMesh&, std::size_t, std::byte*)> encode{};
};

/// The box of the positions in double, and whether floats hold them.
struct GlbBox {
  std::array<double, 3> low{}, high{};
  std::array<double, 3> middle{};  ///< what is taken away from positions that floats do not hold
  bool floats = true;
};

/// Throws Error(usage) for positions that are not finite or too far apart for floats.
GlbBox glb_box_of(MeshBlocks& mesh, const std::string& name);

/// Positions, normals, colours and attributes of vertices in that box, which may be part of the mesh's.
std::vector<GlbColumn> glb_columns(const AttributeLayout& layout, bool normals, const GlbBox& box);

/// What one buffer holds of a mesh: columns of vertices, triangles that count from the first of these, and which of the
/// mesh's vertices these are.
struct GlbPiece {
  std::uint64_t vertices = 0, triangles = 0;
  GlbBox box{};            ///< of its positions
  std::uint64_t runs = 0;  ///< of vertices that follow each other in the mesh; 0: it has all of them
  std::string uri{};       ///< of the file that holds it; empty: the GLB itself
};

inline constexpr std::size_t kGlbTriangleBytes = 3 * sizeof(std::uint32_t);
inline constexpr std::size_t kGlbRunBytes = 2 * sizeof(std::uint32_t);  ///< the first vertex, and how many

/// Everything but the data: one mesh of one node, a primitive for each piece. In the buffers pieces' columns follow
/// each other, then triangles, then runs. Filled up with spaces to four bytes.
std::string describe_glb(const MeshBlocks& mesh, const std::vector<GlbPiece>& pieces);

/// Bytes handed on in large pieces.
class GlbBytes {
 public:
  using Sink = std::function<void(std::string_view)>;
  explicit GlbBytes(const Sink& out) : out_(out) { bytes_.reserve(kHeld + kMostGlbColumn); }
  template <class T>
  void add(T value) {
    append_little(bytes_, value);
    if (bytes_.size() >= kHeld) flush();
  }
  void add(const std::byte* from, std::size_t count) {
    bytes_.append(reinterpret_cast<const char*>(from), count);
    if (bytes_.size() >= kHeld) flush();
  }
  /// What the container begins with: its length, the JSON, and the head of the data.
  void add_head(const std::string& json, std::uint64_t data);
  void flush() {
    out_(bytes_);
    bytes_.clear();
  }

 private:
  static constexpr std::size_t kHeld = 1U << 20;
  const Sink& out_;
  std::string bytes_;
};

/// Of the whole file.
std::uint64_t glb_file_bytes(const std::string& json, std::uint64_t data);

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

// Where the vertices of a mesh stand that a GLB has in several pieces.

/// The pieces of a mesh that is one again once they are read: vertices that several of them have become one, and all of
/// them stand in the mesh's own order. Where another program has changed that, they stay as they are.
class GlbSeats {
 public:
  explicit GlbSeats(const TriangleMesh& mesh) : vertex_(mesh.positions.size()), triangle_(mesh.triangles.size()) {}

  void forget() { known_ = false; }
  void add(std::uint64_t first, std::uint64_t count) {
    known_ = known_ && count <= kMost && first + count <= kMost && in_piece_ + count <= kMost;
    if (!known_) return;
    runs_.push_back({first, count});
    in_piece_ += count;
    end_ = std::max(end_, first + count);
  }
  /// Of as many vertices.
  void end_piece(std::uint64_t vertices) {
    known_ = known_ && in_piece_ == vertices;
    in_piece_ = 0;
  }
  void take(TriangleMesh& mesh) const {
    const std::uint64_t there = mesh.positions.size() - vertex_;
    if (!known_ || runs_.empty() || end_ > there) return;
    std::vector<std::uint32_t> seats;
    seats.reserve(there);
    for (const auto& [first, count] : runs_) {
      for (std::uint64_t i = 0; i < count; ++i) seats.push_back(static_cast<std::uint32_t>(first + i));
    }
    if (!fill(seats, mesh)) return;
    move_to(seats, mesh.positions);
    move_to(seats, mesh.normals);
    for (std::vector<float>& values : mesh.attributes) move_to(seats, values);
    for (std::size_t t = triangle_; t < mesh.triangles.size(); ++t) {
      for (std::uint32_t& v : mesh.triangles[t]) v = static_cast<std::uint32_t>(vertex_ + seats[v - vertex_]);
    }
  }

 private:
  static constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();

  /// Every seat has a vertex, and all those of one lie in the same place.
  [[nodiscard]] bool fill(const std::vector<std::uint32_t>& seats, const TriangleMesh& mesh) const {
    std::vector<std::uint32_t> holder(end_, kMost);
    for (std::uint32_t v = 0; v < seats.size(); ++v) {
      std::uint32_t& first = holder[seats[v]];
      if (first == kMost) first = v;
      if (mesh.positions[vertex_ + first] != mesh.positions[vertex_ + v]) return false;
    }
    return std::find(holder.begin(), holder.end(), kMost) == holder.end();
  }
  template <class T>
  void move_to(const std::vector<std::uint32_t>& seats, std::vector<T>& values) const {
    std::vector<T> seated(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(vertex_));
    seated.resize(vertex_ + end_);
    for (std::size_t v = 0; v < seats.size(); ++v) seated[vertex_ + seats[v]] = values[vertex_ + v];
    values = std::move(seated);
  }

  std::size_t vertex_, triangle_;  ///< the first ones
  std::vector<std::pair<std::uint64_t, std::uint64_t>> runs_;
  std::uint64_t in_piece_ = 0, end_ = 0;
  bool known_ = true;
};

}  // namespace lamina::meshes

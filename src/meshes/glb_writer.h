// A GLB as it is written: what it holds of each vertex, its JSON, and its bytes on their way to the file.
#pragma once
#include <nlohmann/json.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "base/little_endian.h"
#include "lamina/attributes.h"
#include "lamina/mesh.h"
#include "meshes/writers.h"

namespace lamina::meshes {

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

}  // namespace lamina::meshes

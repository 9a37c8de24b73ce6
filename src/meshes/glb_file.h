// A GLB read and checked: its JSON, and the numbers of its accessors.
#pragma once
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "lamina/mesh.h"
#include "meshes/formats.h"
#include "meshes/glb.h"

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

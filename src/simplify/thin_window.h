// The part of a streamed mesh that is being thinned out: what has been read last, and what was read before and waits
// for triangles that are still to come.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "lamina/mesh.h"
#include "meshes/formats.h"
#include "meshes/vec3.h"
#include "simplify/matching.h"
#include "simplify/quadric.h"
#include "simplify/stars.h"

namespace lamina::simplify {

/// A vertex whose triangles close around it gets no more of them. Until they do it is *open* and stays; one that stays
/// open for long is taken for a boundary's.
class ThinWindow {
 public:
  /// `deviation`: of thin_blocks(). Refers to the mesh.
  ThinWindow(meshes::MeshBlocks& mesh, double deviation);

  /// Takes the next triangles of the mesh.
  void add(std::span<const Triangle> triangles);

  /// Some of its triangles, with vertices numbered anew.
  struct Part {
    std::vector<std::uint32_t> triangles, vertices;  ///< of the window
    std::vector<std::uint8_t> split;                 ///< vertices that have triangles outside, too
    ThinPart thin;
  };
  /// `numbers`: kNone of each vertex, before and after; grows.
  [[nodiscard]] Part part(std::span<const std::uint32_t> triangles, std::vector<std::uint32_t>& numbers) const;
  /// Parts that share no triangle may be put back at once.
  void put_back(const Part& part);
  /// All parts are back. Returns the triangles at vertices that were split, and those around them.
  std::vector<std::uint32_t> settle(std::span<const Part> parts);

  [[nodiscard]] std::size_t triangles() const { return triangles_.size(); }
  /// Three times the centre of a triangle, from that of the window's first.
  [[nodiscard]] std::array<float, 3> centre(std::size_t triangle) const;

  /// Hands over the triangles that none to come can change, with their vertices; all of them where this is the last
  /// time.
  TriangleMesh give(bool last);
  [[nodiscard]] std::uint32_t vertices_given() const { return given_; }

 private:
  struct Vertex {
    meshes::Vec3 position{};
    std::array<float, 3> normal{};
    std::uint32_t id = 0;          ///< in the mesh
    std::uint32_t number = kNone;  ///< in what was given; kNone: it was not, and may move
    std::uint32_t age = 0;         ///< blocks since it came
    bool open = true;              ///< where it was given: it was open then
    float budget = 0;              ///< ThinPart::budgets
    Quadric quadric;               ///< about its place
  };
  /// One value for each vertex.
  using Values = std::vector<std::vector<float>>;

  void take_in(std::span<const std::uint32_t> ids, std::vector<std::uint32_t>& places);
  void read(std::span<const std::uint32_t> ids, std::span<const std::uint32_t> places);
  void add_planes(std::size_t first);
  void count_triangles();
  void find_open();
  [[nodiscard]] std::vector<std::uint8_t> find_waiting() const;
  void spread(std::vector<std::uint8_t>& marks) const;
  void number(const Triangle& triangle, TriangleMesh& out);
  void keep_vertices();

  meshes::MeshBlocks& mesh_;
  double deviation_;
  std::vector<Triangle> triangles_;
  std::vector<Vertex> vertices_;      ///< ascending by id
  Values values_, low_, high_;        ///< attributes; their range over what a vertex stands for
  std::vector<std::uint32_t> count_;  ///< triangles of each vertex
  std::unordered_map<std::uint32_t, std::uint32_t> boundary_;  ///< given, open, and not here: numbers by id
  std::vector<bool> done_;  ///< of the mesh's vertices: no triangle may name it again
  std::uint32_t given_ = 0;
};

}  // namespace lamina::simplify

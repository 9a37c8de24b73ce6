// A streamed mesh thinned out where it is flat, in one pass from its first triangle to its last: block by block, each
// by itself, and along the seams of these.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <unordered_map>
#include <vector>

#include "lamina/mesh.h"
#include "lamina/run.h"
#include "lamina/simplify.h"
#include "meshes/formats.h"
#include "meshes/mesh_blocks.h"
#include "simplify/matching.h"
#include "simplify/quadric.h"
#include "simplify/stars.h"

namespace lamina::simplify {

/// Triangles that follow each other, with their vertices. Where these do not close around a vertex it is *open*, and
/// locked: there may be others.
struct ThinBlock {
  ThinPart part;
  std::vector<std::uint32_t> ids;  ///< of the vertices in the mesh, ascending
  /// Of each vertex: over triangles the sum of a hash of the vertex that follows less one of that before. 0: closed.
  std::vector<std::uint64_t> turns;

  /// In the memory that is there. Throws Error(unreadable) for triangles that name vertices that are not there or
  /// repeat one, and for vertices that are nowhere.
  void read(meshes::MeshBlocks& mesh, std::uint64_t first, std::size_t count);
  /// What its vertices stand for, what contracting them may cost, and which are open. `deviation`: of thin_blocks().
  void survey(double deviation);
};

[[noreturn]] void refuse_to_thin(const char* what);

/// Holds the triangles at vertices that are open yet. One that stays open for long is taken for a boundary's.
class ThinSeams {
 public:
  /// `tolerances`: how far the values of an attribute may differ that one vertex stands for.
  ThinSeams(const meshes::MeshBlocks& mesh, std::vector<float> tolerances);

  /// Takes the next block, and hands over the triangles that none to come can change, with their vertices; all of them
  /// where it is the last. Triangles name vertices counted over all that was handed over. Throws Error(unreadable) for
  /// meshes found not to be manifold.
  TriangleMesh join(const ThinBlock& block, bool last, const RunContext& run);

  [[nodiscard]] std::uint32_t vertices_given() const { return given_; }
  /// Contractions along seams, and what Matching::Result says of them.
  [[nodiscard]] std::uint64_t contractions() const { return contractions_; }
  [[nodiscard]] double deviation() const { return deviation_; }

 private:
  struct Vertex {
    StandIn stands;
    std::array<float, 3> normal{};
    float budget = 0;              ///< ThinPart::budgets
    std::uint64_t turns = 0;       ///< ThinBlock::turns
    std::uint32_t id = 0;          ///< in the mesh
    std::uint32_t number = kNone;  ///< in what was given; kNone: it was not
    std::uint32_t age = 0;         ///< blocks since it came
    bool open = false;             ///< where it was given: it was open then
    bool news = false;             ///< the last block closed it
  };
  /// One value for each vertex.
  using Values = std::vector<std::vector<float>>;

  void note_vertices(const ThinBlock& block);
  void give_inner(const ThinBlock& block, TriangleMesh& out);
  void take_in(const ThinBlock& block);
  void put(const ThinBlock& block, std::uint32_t from, std::uint32_t to, bool is_new);
  void thin(const RunContext& run);
  void take_out(std::span<const std::uint32_t> triangles);
  void put_back(std::span<const std::uint32_t> triangles);
  void give(bool last, TriangleMesh& out);
  void count_triangles();
  void keep_vertices();

  std::vector<float> tolerances_;
  AttributeLayout layout_;
  bool normals_;
  std::vector<Triangle> triangles_;
  std::vector<Vertex> vertices_;      ///< ascending by id
  Values values_, low_, high_;        ///< attributes; their range over what a vertex stands for
  std::vector<std::uint32_t> count_;  ///< triangles of each vertex
  std::unordered_map<std::uint32_t, std::uint32_t> boundary_;  ///< given, open, and not here: numbers by id
  std::vector<bool> seen_, closed_;  ///< of the mesh's vertices: triangles named them; no other may
  std::uint32_t given_ = 0;
  std::uint64_t contractions_ = 0;
  double deviation_ = 0;

  std::vector<std::uint32_t> numbers_;  ///< of a block's vertices in what was given, or kNone
  std::vector<std::uint32_t> seam_;     ///< of a block: its triangles at open vertices, and around these
  ThinPart part_;                       ///< what is thinned out of the window, by
  std::vector<std::uint32_t> taken_;    ///< these of its vertices
  Matching matching_;
};

/// Triangles that are read at once: no more of any mesh.
constexpr std::size_t kThinBlock = 1U << 18;
/// Of a mesh of so many. Part of what the result is.
std::size_t thin_block_of(std::uint64_t triangles);

/// Contracts edges while the root mean square distance of the new vertex from the planes it stands for is at most
/// `deviation` (> 0) times the length of an edge there. Vertices on boundaries stay where they are. Triangles had
/// better name vertices near those of the triangle before, as in streamed meshes. Gives the result to `take` piece by
/// piece: its triangles name vertices counted over all pieces. `block`: of thin_block_of(), where it is 0. Throws
/// Error(unreadable) for triangles that name vertices that are not there or repeat one, and for meshes found not to be
/// manifold, Error(internal) when cancelled.
SimplifyStats thin_blocks(meshes::MeshBlocks& mesh, double deviation, const std::function<void(TriangleMesh)>& take,
                          const RunContext& run, std::size_t block = 0);

}  // namespace lamina::simplify

// Where a mesh is cut into tiles: an octree over its vertices.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "meshes/formats.h"
#include "meshes/vec3.h"

namespace lamina::tiles {

constexpr std::uint32_t kNoTile = 0xFFFFFFFF;

/// The box of a mesh's vertices.
struct Extent {
  meshes::Vec3 low{}, high{};
  [[nodiscard]] double longest() const;
  [[nodiscard]] meshes::Vec3 middle() const;
};

/// Throws Error(unreadable) for a coordinate that is not finite.
Extent extent_of(meshes::MeshBlocks& mesh);

/// A tile's place in the tree.
struct TileNode {
  std::uint32_t parent = kNoTile;
  int depth = 0;  ///< 0: the root
  std::vector<std::uint32_t> children{};
  double side = 0;     ///< of the cube of cells that a leaf's vertices lie in
  std::string name{};  ///< of its file, without ending: the way from the root
  [[nodiscard]] bool leaf() const { return children.empty(); }
};

/// Cells of an octree are cut in eight until none has more than a small part of a tile; tiles are boxes of cells with
/// nearly as many vertices each, and so are the tiles above them of their tiles. Cut by vertices, of which a mesh has
/// half as many as triangles.
class TileOctree {
 public:
  /// With `wanted` vertices a leaf, more or less. Reads the vertices once, and once more where some lie much closer
  /// than others.
  TileOctree(meshes::MeshBlocks& mesh, const Extent& extent, std::uint64_t wanted);

  [[nodiscard]] const std::vector<TileNode>& nodes() const {
    return nodes_;
  }  ///< the root first, parents before children
  /// The leaf whose cells a place lies in.
  [[nodiscard]] std::uint32_t leaf_at(const meshes::Vec3& at) const;
  /// The deepest node that has both below it, or is one of them.
  [[nodiscard]] std::uint32_t common(std::uint32_t a, std::uint32_t b) const;

 private:
  static constexpr int kDeepest = 20;
  struct Cell {
    std::array<std::uint32_t, 8> child{};  ///< 0: none
    std::uint64_t vertices = 0;
    int depth = 0;
    bool split = false;
    std::uint32_t tile = kNoTile;
  };
  struct Counted {
    std::uint64_t key, vertices;
  };
  /// A cell with vertices, in units of the finest.
  struct Filled {
    std::array<double, 3> middle{};
    double half = 0;
    std::uint64_t vertices = 0;
    std::uint32_t cell = 0;
  };
  /// Cells for some number of leaves.
  struct Lot {
    std::span<Filled> cells;
    std::uint64_t leaves;
  };

  [[nodiscard]] std::array<std::uint32_t, 3> place(const meshes::Vec3& at) const;
  [[nodiscard]] std::uint32_t cell_at(const std::array<std::uint32_t, 3>& place) const;
  bool count_and_split(meshes::MeshBlocks& mesh, int levels);
  void split(std::uint32_t cell, const Counted* begin, const Counted* end, int levels);
  void list_cells(std::uint32_t cell, const std::array<double, 3>& low, std::vector<Filled>& out) const;
  static void share_out(const Lot& lot, int times, std::vector<Lot>& out);
  void make_tiles(const Lot& lot, std::uint32_t node);
  std::uint32_t add_node(std::uint32_t parent, int digit);

  Extent extent_;
  double scale_ = 0;        ///< finest cells a unit
  std::uint64_t most_ = 1;  ///< vertices in a cell
  std::vector<Cell> cells_;
  std::vector<TileNode> nodes_;
};

}  // namespace lamina::tiles

// No two vertices of a mesh at one position: programs that weld by position (STL knows nothing else) then find the mesh
// as manifold as it is.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "meshes/mesh_sink.h"

namespace lamina {

/// Takes a mesh slab by slab and moves what would be written at the position of a vertex before it, of the same slab or
/// of the one below, by as few steps of the number type as it takes. Such vertices are rare: corners whose samples all
/// lie in one point, and neighbours that round to one float where coordinates are large. What is moved, and where to,
/// depends on the two slabs as they were placed, and on nothing that was moved in the one below: parts of a mesh find
/// the same. Keeps 16 bytes for a vertex of the two slabs, 32 at the most.
class DistinctPositions {
 public:
  /// `double_positions`: as they are written; else floats.
  explicit DistinctPositions(bool double_positions) : double_(double_positions) {}

  /// The next slab's vertices.
  void separate(VertexBatch& vertices);
  /// Keeps others away from a position, as the slab below does, for the next separate(). Not mixed with slabs.
  void occupy(double x, double y, double z) { below_.insert(fingerprint(x, y, z)); }

 private:
  /// 64-bit numbers but 0; grows.
  class Set {
   public:
    void clear(std::size_t expected);
    bool insert(std::uint64_t value);  ///< false where it is there
    [[nodiscard]] bool contains(std::uint64_t value) const;
    /// Asks for where a value that is looked for soon would be.
    void ask_for(std::uint64_t value) const {
      if (!seats_.empty()) __builtin_prefetch(&seats_[value & (seats_.size() - 1)]);
    }

   private:
    [[nodiscard]] std::size_t seat_of(std::uint64_t value) const;
    std::vector<std::uint64_t> seats_;  ///< a power of two, at most half of them taken; 0 is free
    std::size_t size_ = 0;
  };

  /// Of the position as it is written. Two that differ have the same by a chance of 2^-64: then one moves for nothing.
  [[nodiscard]] std::uint64_t fingerprint(double x, double y, double z) const;
  void move(VertexBatch& vertices, std::size_t i, int steps) const;

  bool double_;
  Set below_, here_;
  std::vector<std::size_t> late_;  ///< vertices at positions that were taken
};

}  // namespace lamina

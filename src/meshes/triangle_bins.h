// Triangles sorted into bins on disk: those of a region, of a tile.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/spill_file.h"

namespace lamina::meshes {

/// The bin of a triangle, whose corners lie in these: the one with most of them, else the first.
inline std::uint32_t bin_of_triangle(const std::array<std::uint32_t, 3>& homes) {
  if (homes[0] == homes[1] || homes[0] == homes[2]) return homes[0];
  if (homes[1] == homes[2]) return homes[1];
  return std::min({homes[0], homes[1], homes[2]});
}

/// With a buffer in memory for each bin, 48 MB in all or less, and a temporary file.
class TriangleBins {
 public:
  using Corners = std::array<std::uint32_t, 3>;

  TriangleBins(std::size_t bins, const std::string& tmp_dir);
  /// Throws Error(budget) for a full disk, as finish() does.
  void add(std::uint32_t bin, const Corners& corners) {
    Bin& to = bins_[bin];
    to.held.push_back(corners);
    if (to.held.size() >= most_held_) spill(to);
  }
  /// All are there.
  void finish();
  /// In the order in which they came; after finish(). Safe from several threads. Throws Error(budget) when they cannot
  /// be read.
  [[nodiscard]] std::vector<Corners> read(std::uint32_t bin) const;

 private:
  struct Chunk {
    std::uint64_t offset;
    std::size_t count;
  };
  struct Bin {
    std::vector<Corners> held;
    std::vector<Chunk> chunks;
  };
  void spill(Bin& bin);

  SpillFile file_;
  std::vector<Bin> bins_;
  std::size_t most_held_;
};

}  // namespace lamina::meshes

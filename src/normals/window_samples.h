// The samples around the slab being worked on, with what has been found out about them.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace lamina::normals {

/// Node of the patch graph that every normal with a fixed sign belongs to.
inline constexpr std::uint32_t kFixed = 0;
/// Of samples that have no normal, or none yet.
inline constexpr std::uint32_t kNoNode = ~0U;

/// Parallel arrays. A normal's sign is relative to its patch: times the patch's sign it is the sample's.
struct WindowSamples {
  std::vector<std::int32_t> x, y, z;  ///< steps of the frame
  std::vector<float> nx, ny, nz;      ///< unit length, or zero
  std::vector<std::uint64_t> row;     ///< of the input
  std::vector<std::uint32_t> node;    ///< of the patch graph
  std::vector<std::uint8_t> given;    ///< 1: the normal comes from the input

  [[nodiscard]] std::size_t size() const { return x.size(); }
  [[nodiscard]] bool has_normal(std::size_t i) const { return nx[i] != 0 || ny[i] != 0 || nz[i] != 0; }
  void clear();
  void append(const WindowSamples& from, std::size_t i);
  /// Sample i becomes from[order[i]].
  void gather(const WindowSamples& from, std::span<const std::uint32_t> order);
};

/// The samples of the slab itself, and to which of their neighbours each is linked.
struct Links {
  static constexpr std::size_t kMost = 8;
  std::vector<std::uint32_t> core;                           ///< their places in the window, ascending
  std::vector<std::array<std::uint32_t, kMost>> neighbours;  ///< places; unused ones repeat the sample itself
  std::vector<float> scale;  ///< squared distance of the farthest neighbour taken, steps^2
};

/// What two neighbours say about each other's sign, in -1..1: the cosine between one's normal and the other's mirrored
/// at the plane between them. On a sphere, around an edge and across a thin wall that tells the sign where the plain
/// cosine does not; `scale` keeps noise between very near samples from passing for a wall.
float agreement(const std::array<float, 3>& offset, const std::array<float, 3>& a, const std::array<float, 3>& b,
                float scale);

}  // namespace lamina::normals

// A mesh cut into boxes of triangles.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace lamina::simplify {

/// A triangle on its way into a box.
struct Centre {
  std::array<float, 3> at{};
  std::uint32_t triangle = 0;
};

/// Sorts the triangles into boxes of at most `most`, cut across the longest side of what is there, `share` of the
/// triangles on the lower side, above 0 and below 1: another share, other boxes. Returns where each box begins, and the
/// end. Within a box they are sorted by number. The result does not depend on the number of threads.
std::vector<std::size_t> cut_into_boxes(std::span<Centre> triangles, std::size_t most, double share);

}  // namespace lamina::simplify

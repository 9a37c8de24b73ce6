// A mesh cut into boxes of triangles.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace lamina::simplify {

/// A triangle on its way into a box.
struct Centre {
  std::array<float, 3> at{};
  std::uint32_t triangle = 0;
};

/// Cuts triangles 0 to their number into boxes of at most `most`, across the longest side of what is there, `share` of
/// the triangles on the lower side, above 0 and below 1: another share, other boxes. `order`: triangles box by box, in
/// each by number. Returns where each box begins, and the end. The result does not depend on the number of threads.
std::vector<std::size_t> cut_into_boxes(std::vector<Centre> triangles, std::size_t most, double share,
                                        std::vector<std::uint32_t>& order);

}  // namespace lamina::simplify

#include "simplify/cut.h"

#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <span>

namespace lamina::simplify {
namespace {

std::size_t lower_part(std::size_t count, double share) {
  return std::clamp<std::size_t>(static_cast<std::size_t>(share * static_cast<double>(count)), 1, count - 1);
}

std::size_t longest_side(std::span<const Centre> triangles) {
  std::array<float, 3> low = triangles[0].at, high = low;
  for (const Centre& c : triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], c.at[k]);
      high[k] = std::max(high[k], c.at[k]);
    }
  }
  std::size_t longest = 0;
  for (std::size_t k = 1; k < 3; ++k) {
    if (high[k] - low[k] > high[longest] - low[longest]) longest = k;
  }
  return longest;
}

/// In a box they are in no order.
void part_into_boxes(std::span<Centre> triangles, std::size_t most, double share) {
  if (triangles.size() <= most) return;
  const std::size_t axis = longest_side(triangles), lower = lower_part(triangles.size(), share);
  std::nth_element(triangles.begin(), triangles.begin() + static_cast<std::ptrdiff_t>(lower), triangles.end(),
                   [axis](const Centre& a, const Centre& b) {
                     return a.at[axis] < b.at[axis] || (a.at[axis] == b.at[axis] && a.triangle < b.triangle);
                   });
  tbb::parallel_invoke([&] { part_into_boxes(triangles.first(lower), most, share); },
                       [&] { part_into_boxes(triangles.subspan(lower), most, share); });
}

void add_starts(std::size_t begin, std::size_t count, std::size_t most, double share,
                std::vector<std::size_t>& starts) {
  if (count <= most) {
    starts.push_back(begin);
    return;
  }
  const std::size_t lower = lower_part(count, share);
  add_starts(begin, lower, most, share, starts);
  add_starts(begin + lower, count - lower, most, share, starts);
}

}  // namespace

std::vector<std::size_t> cut_into_boxes(std::vector<Centre> triangles, std::size_t most, double share,
                                        std::vector<std::uint32_t>& order) {
  const auto count = static_cast<std::uint32_t>(triangles.size());
  std::vector<std::size_t> starts;
  add_starts(0, count, most, share, starts);
  starts.push_back(count);
  if (count > 0) part_into_boxes(triangles, most, share);
  std::vector<std::uint32_t> box(count);
  for (std::uint32_t b = 0; b + 1 < starts.size(); ++b) {
    for (std::size_t i = starts[b]; i < starts[b + 1]; ++i) box[triangles[i].triangle] = b;
  }
  std::vector<std::size_t> next = starts;
  order.resize(count);
  for (std::uint32_t t = 0; t < count; ++t) order[next[box[t]]++] = t;
  return starts;
}

}  // namespace lamina::simplify

#include "normals/occupancy.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace lamina::normals {
namespace {

using meshes::Vec3;

constexpr std::size_t kMostCubes = 256;   ///< along an axis: two million bytes
constexpr std::size_t kMargin = 3;        ///< empty cubes around all
constexpr std::uint32_t kLeastCount = 4;  ///< samples of a patch that can hide something
constexpr double kFar = std::numeric_limits<double>::max();

std::ptrdiff_t whole(double v) {
  return static_cast<std::ptrdiff_t>(std::floor(v));
}

}  // namespace

Occupancy::Occupancy(const PatchGraph& graph) {
  if (!(graph.cell > 0) || graph.nodes.size() < 2) return;
  Vec3 low = meshes::to_double(graph.nodes[1].centre);
  Vec3 high = low;
  for (std::size_t i = 2; i < graph.nodes.size(); ++i) {
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], double{graph.nodes[i].centre[a]});
      high[a] = std::max(high[a], double{graph.nodes[i].centre[a]});
    }
  }
  double extent = 0;
  for (std::size_t a = 0; a < 3; ++a) extent = std::max(extent, high[a] - low[a]);
  side_ = std::max(double{graph.cell}, extent / static_cast<double>(kMostCubes - 2 * kMargin - 1));
  diagonal_ = std::max(1.0, meshes::norm(meshes::operator-(high, low)) / side_);
  std::size_t cubes = 1;
  for (std::size_t a = 0; a < 3; ++a) {
    origin_[a] = low[a] - static_cast<double>(kMargin) * side_;
    size_[a] = whole((high[a] - low[a]) / side_) + 1 + 2 * static_cast<std::ptrdiff_t>(kMargin);
    cubes *= static_cast<std::size_t>(size_[a]);
  }
  taken_.assign(cubes, false);
  for (std::size_t i = 1; i < graph.nodes.size(); ++i) {
    if (graph.nodes[i].count < kLeastCount) continue;
    const Vec3 at = place(graph.nodes[i]);
    taken_[index({whole(at[0]), whole(at[1]), whole(at[2])})] = true;
  }
}

Vec3 Occupancy::place(const PatchNode& node) const {
  Vec3 at{};
  for (std::size_t a = 0; a < 3; ++a) at[a] = (double{node.centre[a]} - origin_[a]) / side_;
  return at;
}

double Occupancy::way(const Vec3& at, const Vec3& direction) const {
  Cube cube{};
  Cube step{};
  Vec3 next{};  // how far it is to the next wall across each axis
  Vec3 each{};  // and from one wall to the next
  for (std::size_t a = 0; a < 3; ++a) {
    cube[a] = whole(at[a]);
    if (cube[a] < 0 || cube[a] >= size_[a]) return kFar;
    step[a] = direction[a] < 0 ? -1 : 1;
    each[a] = direction[a] == 0 ? kFar : 1 / std::abs(direction[a]);
    const double before = at[a] - static_cast<double>(cube[a]);
    next[a] = direction[a] == 0 ? kFar : (direction[a] < 0 ? before : 1 - before) * each[a];
  }
  for (double gone = 0;;) {
    if (taken_[index(cube)]) return gone;
    std::size_t a = next[0] < next[1] ? 0 : 1;
    if (next[2] < next[a]) a = 2;
    gone = next[a];
    next[a] += each[a];
    cube[a] += step[a];
    if (cube[a] < 0 || cube[a] >= size_[a]) return kFar;
  }
}

}  // namespace lamina::normals

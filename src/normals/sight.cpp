#include "normals/sides.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "meshes/vec3.h"
#include "normals/sample_window.h"

namespace lamina::normals {

std::vector<SeenFrom> scanners_of(const PointSourceInfo& info, const NormalsSettings& settings) {
  std::vector<SeenFrom> seen;
  const bool one_each = settings.viewpoints.size() > 1 && settings.viewpoints.size() == info.scans.size();
  for (std::size_t i = 0; i < info.scans.size(); ++i) {
    const ScanPart& scan = info.scans[i];
    SeenFrom s;
    s.first = scan.first;
    if (one_each) {
      s.known = true;
      s.viewpoint = settings.viewpoints[i];
    } else if (settings.viewpoints.empty() && settings.scanners) {
      const bool known = scan.scanner == ScanPart::Scanner::position || scan.scanner == ScanPart::Scanner::direction;
      s.known = known || (settings.pose_origins && scan.scanner == ScanPart::Scanner::pose_origin);
      s.viewpoint = {scan.at, scan.scanner == ScanPart::Scanner::direction};
    }
    seen.push_back(s);
  }
  return seen;
}

Viewpoints::Local Viewpoints::local(const Viewpoint& viewpoint, const Frame& frame) {
  const Eigen::Vector3d at(viewpoint.at[0], viewpoint.at[1], viewpoint.at[2]);
  const Eigen::Vector3d there =
      viewpoint.direction ? Eigen::Vector3d((frame.rotation * at).normalized()) : frame.to_local(at);
  return {{there.x(), there.y(), there.z()}, viewpoint.direction};
}

Viewpoints::Viewpoints(const std::vector<Viewpoint>& everywhere, const std::vector<SeenFrom>& by_row,
                       const Frame& frame) {
  for (const Viewpoint& v : everywhere) everywhere_.push_back(local(v, frame));
  any_ = !everywhere.empty();
  for (const SeenFrom& rows : by_row) {
    by_row_.push_back({rows.first, rows.known, local(rows.viewpoint, frame)});
    any_ = any_ || rows.known;
  }
}

float Viewpoints::vote(std::uint64_t row, const std::array<std::int32_t, 3>& at,
                       const std::array<float, 3>& normal) const {
  const auto sight = [&](const Local& from) {
    if (from.direction) return from.at;
    return std::array<double, 3>{from.at[0] - at[0], from.at[1] - at[1], from.at[2] - at[2]};
  };
  const auto squared = [](const std::array<double, 3>& d) { return d[0] * d[0] + d[1] * d[1] + d[2] * d[2]; };
  const Local* from = nullptr;
  const auto rows =
      std::upper_bound(by_row_.begin(), by_row_.end(), row, [](std::uint64_t r, const Rows& s) { return r < s.first; });
  if (rows != by_row_.begin() && std::prev(rows)->known) {
    from = &std::prev(rows)->viewpoint;
  } else {
    double nearest = 0;
    for (const Local& place : everywhere_) {
      const double d2 = squared(sight(place));
      if (from != nullptr && !(d2 < nearest)) continue;
      nearest = d2;
      from = &place;
    }
  }
  if (from == nullptr) return 0;
  const std::array<double, 3> line = sight(*from);
  const double length = std::sqrt(squared(line));
  if (!(length > 0)) return 0;
  const double cosine = (line[0] * normal[0] + line[1] * normal[1] + line[2] * normal[2]) / length;
  return static_cast<float>(from->direction ? kFromFar * cosine : cosine);
}

namespace {

using meshes::Vec3;

constexpr std::size_t kMostCubes = 256;  ///< along an axis: two million bytes
constexpr std::size_t kMargin = 3;       ///< empty cubes around all
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

namespace {

using meshes::dot;
using meshes::Vec3;

constexpr std::size_t kDirections = 98;  ///< over the whole sphere: a quarter of them to each side of a patch
constexpr double kCone = 0.5;            ///< least cosine to the normal of directions whose way counts
constexpr double kGlancing = 0.15;       ///< of those that may be open

/// To the places of a lattice around: about even over the sphere, and the same bits everywhere.
std::array<Vec3, kDirections> directions_all_around() {
  std::array<Vec3, kDirections> directions;
  std::size_t n = 0;
  for (int x = -2; x <= 2; ++x) {
    for (int y = -2; y <= 2; ++y) {
      for (int z = -2; z <= 2; ++z) {
        const bool odd = x % 2 != 0 || y % 2 != 0 || z % 2 != 0;  // else half as far lies the same, or nothing
        if (odd) directions[n++] = meshes::unit({double(x), double(y), double(z)});
      }
    }
  }
  return directions;
}

Sight look_from(const PatchNode& node, const Occupancy& around, const std::array<Vec3, kDirections>& directions) {
  Sight sight;
  const Vec3 outward{node.outward[0], node.outward[1], node.outward[2]};
  const double length = std::sqrt(dot(outward, outward));
  constexpr double kFlat = 0.5;  // of its area: crumpled patches have no sides
  if (!(length > kFlat * double{node.area})) return sight;
  const Vec3 at = around.place(node);
  for (const double side : {1.0, -1.0}) {
    Vec3 normal{};
    Vec3 from{};
    for (std::size_t a = 0; a < 3; ++a) {
      normal[a] = side * outward[a] / length;
      from[a] = at[a] + Occupancy::kClear * normal[a];
    }
    double open = 0;
    double looks = 0;
    double way = 0;
    double ways = 0;
    for (const Vec3& direction : directions) {
      const double cosine = dot(direction, normal);
      if (cosine < kGlancing) continue;
      const double free = std::min(1.0, around.way(from, direction) / around.diagonal());
      open += free < 1 ? 0 : 1;
      looks += 1;
      if (cosine < kCone) continue;
      way += free;
      ways += 1;
    }
    View& view = side > 0 ? sight.front : sight.back;
    view.open = static_cast<float>(open / looks);
    view.way = static_cast<float>(way / ways);
  }
  return sight;
}

}  // namespace

std::vector<float> choose_looks(const std::vector<std::uint32_t>& root) {
  constexpr std::uint32_t kMost = 4096;  ///< of a body: a share of 1.25 % of it is known to 0.2 %
  std::vector<std::uint32_t> patches(root.size(), 0);
  for (const std::uint32_t r : root) ++patches[r];
  std::vector<std::uint32_t> number(root.size(), 0);
  std::vector<float> looks(root.size(), 0);
  for (std::size_t i = 1; i < root.size(); ++i) {
    if (root[i] == kFixed) continue;
    const std::uint32_t every = (patches[root[i]] + kMost - 1) / kMost;
    if (number[root[i]]++ % every == every / 2) looks[i] = static_cast<float>(every);
  }
  return looks;
}

std::vector<Sight> look_around(const PatchGraph& graph, const Occupancy& around, const std::vector<float>& looks) {
  std::vector<Sight> sights(graph.nodes.size());
  if (around.empty()) return sights;
  const std::array<Vec3, kDirections> directions = directions_all_around();
  tbb::parallel_for(tbb::blocked_range<std::size_t>(1, graph.nodes.size(), 64), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      if (looks[i] > 0) sights[i] = look_from(graph.nodes[i], around, directions);
    }
  });
  return sights;
}

}  // namespace lamina::normals

// How good a mesh of a scan is, in the ways an eye sees and mean distances hide.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <ostream>
#include <tuple>
#include <unordered_map>
#include <utility>
#include <vector>

#include "base/hashing.h"
#include "lamina/mesh.h"
#include "measure/triangle_bvh.h"
#include "meshes/vec3.h"
#include "scenes/scanner.h"
#include "support/mesh_check.h"

namespace lamina::test::scenes {

using namespace meshes;

/// Lengths in the scan's spacings; shares in percent.
struct MeshQuality {
  double error = 0;     ///< root mean square distance of the mesh from the truth
  double missing = 0;   ///< of what was seen: farther than 2 from the mesh
  double invented = 0;  ///< of the mesh's area: farther than 3 from all that was seen
  double layers = 0;    ///< mesh area within 2 of the truth over the truth's area within 2 of the mesh
  double flipped = 0;   ///< of the mesh's area: facing away from the nearest truth
  double normals = 0;   ///< degrees, 95th percentile of the faces' within 3 of the truth, sides not told apart
  double shading = 0;   ///< the same of the vertices' own normals, by vertex
  double parts = 0;
  double flakes = 0;      ///< of the triangles: in parts of fewer than 100
  double folds = 0;       ///< of the edges: where two triangles meet at less than 80 degrees
  double loops = 0;       ///< boundary loops
  double ragged = 1;      ///< boundary's length over that of its smoothed curve
  double turn = 0;        ///< degrees, the boundary's mean turning angle by length
  double coincident = 0;  ///< vertices at the exact position of another
};

inline std::ostream& operator<<(std::ostream& out, const MeshQuality& q) {
  return out << "error " << q.error << ", missing " << q.missing << ", invented " << q.invented << ", layers "
             << q.layers << ", flipped " << q.flipped << ", normals " << q.normals << ", shading " << q.shading
             << ", parts " << q.parts << ", flakes " << q.flakes << ", folds " << q.folds << ", loops " << q.loops
             << ", ragged " << q.ragged << ", turn " << q.turn << ", coincident " << q.coincident;
}

/// Whether points lie near a given one: cells of the distance asked for.
class NearPoints {
 public:
  NearPoints(const std::vector<Vec3>& points, double distance) : points_(points), distance_(distance) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto c = cell_of(points[i]);
      cells_[cell_hash(c[0], c[1], c[2])].push_back(i);
    }
  }
  [[nodiscard]] bool any_near(const Vec3& p) const {
    const auto c = cell_of(p);
    for (std::int64_t n = 0; n < 27; ++n) {
      const auto found = cells_.find(cell_hash(c[0] + n % 3 - 1, c[1] + n / 3 % 3 - 1, c[2] + n / 9 - 1));
      if (found == cells_.end()) continue;
      for (const std::size_t i : found->second) {
        if (norm(points_[i] - p) <= distance_) return true;
      }
    }
    return false;
  }

 private:
  [[nodiscard]] std::array<std::int64_t, 3> cell_of(const Vec3& p) const {
    const auto index = [&](double v) { return static_cast<std::int64_t>(std::floor(v / distance_)); };
    return {index(p[0]), index(p[1]), index(p[2])};
  }
  const std::vector<Vec3>& points_;
  double distance_;
  std::unordered_map<std::size_t, std::vector<std::size_t>> cells_;
};

namespace quality_detail {

inline double degrees_between(const Vec3& a, const Vec3& b) {
  const double lengths = norm(a) * norm(b);
  return lengths > 0 ? std::acos(std::clamp(dot(a, b) / lengths, -1.0, 1.0)) * 180 / std::numbers::pi : 0;
}

inline Vec3 face_normal(const TriangleMesh& mesh, std::size_t triangle) {
  const auto& t = mesh.triangles[triangle];
  const Vec3& a = mesh.positions[t[0]];
  return cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a);
}

/// Vertices at one position become one, as many readers make them; triangles that lose a corner go.
inline TriangleMesh welded(const TriangleMesh& mesh) {
  TriangleMesh result;
  std::map<std::array<float, 3>, std::uint32_t> known;
  std::vector<std::uint32_t> number;
  for (const Vec3& p : mesh.positions) {
    const auto [at, is_new] = known.emplace(to_float(p), static_cast<std::uint32_t>(result.positions.size()));
    if (is_new) result.positions.push_back(p);
    number.push_back(at->second);
  }
  for (const auto& t : mesh.triangles) {
    const std::array<std::uint32_t, 3> n{number[t[0]], number[t[1]], number[t[2]]};
    if (n[0] != n[1] && n[1] != n[2] && n[2] != n[0]) result.triangles.push_back(n);
  }
  return result;
}

using Polyline = std::vector<Vec3>;

inline double closed_length(const Polyline& line) {
  double sum = 0;
  for (std::size_t i = 0; i < line.size(); ++i) sum += norm(line[(i + 1) % line.size()] - line[i]);
  return sum;
}

/// The closed line at even steps of half a spacing, under a bell of deviation 3 spacings.
inline Polyline smoothed(const Polyline& line, double spacing) {
  Polyline even;
  const double step = spacing / 2;
  double rest = 0;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const Vec3 &a = line[i], along = line[(i + 1) % line.size()] - a;
    const double l = norm(along);
    for (; rest < l; rest += step) even.push_back(a + (rest / l) * along);
    rest -= l;
  }
  constexpr long kReach = 18;
  const auto count = static_cast<long>(even.size());
  Polyline result;
  for (long i = 0; i < count; ++i) {
    Vec3 sum{};
    double weights = 0;
    for (long d = -kReach; d <= kReach; ++d) {
      const double w = std::exp(-static_cast<double>(d * d) / 72);
      sum = sum + w * even[static_cast<std::size_t>(((i + d) % count + count) % count)];
      weights += w;
    }
    result.push_back((1 / weights) * sum);
  }
  return result;
}

/// Boundary loops, and the shape of those longer than 30 spacings.
inline void judge_boundary(const TriangleMesh& mesh, std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> next,
                           double spacing, MeshQuality& quality) {
  double turned = 0, turned_length = 0, length = 0, smooth_length = 0;
  for (std::uint32_t start = 0; start < mesh.positions.size(); ++start) {
    while (next.contains(start) && !next[start].empty()) {
      Polyline loop;
      std::uint32_t at = start;
      while (next.contains(at) && !next[at].empty()) {
        loop.push_back(mesh.positions[at]);
        const std::uint32_t to = next[at].back();
        next[at].pop_back();
        at = to;
        if (at == start) break;
      }
      ++quality.loops;
      const double l = closed_length(loop);
      if (l < 30 * spacing) continue;
      for (std::size_t i = 0, n = loop.size(); i < n; ++i) {
        const Vec3 in = loop[i] - loop[(i + n - 1) % n], out = loop[(i + 1) % n] - loop[i];
        turned += (norm(in) + norm(out)) * degrees_between(in, out);
        turned_length += norm(in) + norm(out);
      }
      length += l;
      smooth_length += closed_length(smoothed(loop, spacing));
    }
  }
  if (smooth_length > 0) quality.ragged = length / smooth_length;
  if (turned_length > 0) quality.turn = turned / turned_length;
}

/// Parts, folds, boundary.
inline void judge_shape(const TriangleMesh& mesh, double spacing, MeshQuality& quality) {
  struct HalfEdge {
    std::uint32_t low, high;
    std::size_t triangle;
    bool forward;
  };
  std::vector<HalfEdge> edges;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t a = mesh.triangles[t][i], b = mesh.triangles[t][(i + 1) % 3];
      edges.push_back({std::min(a, b), std::max(a, b), t, a < b});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const HalfEdge& a, const HalfEdge& b) {
    return std::tie(a.low, a.high, a.triangle) < std::tie(b.low, b.high, b.triangle);
  });
  UnionFind parts(mesh.triangles.size());
  std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> next;
  double inner = 0, folds = 0;
  for (std::size_t i = 0, end = 0; i < edges.size(); i = end) {
    while (end < edges.size() && edges[end].low == edges[i].low && edges[end].high == edges[i].high) ++end;
    for (std::size_t k = i + 1; k < end; ++k) parts.unite(edges[i].triangle, edges[k].triangle);
    if (end - i == 1) {
      const auto& e = edges[i];  // a boundary runs against its triangle
      next[e.forward ? e.high : e.low].push_back(e.forward ? e.low : e.high);
    } else if (end - i == 2) {
      const double side = edges[i].forward == edges[i + 1].forward ? -1 : 1;
      const Vec3 second = side * face_normal(mesh, edges[i + 1].triangle);
      folds += degrees_between(face_normal(mesh, edges[i].triangle), second) > 100 ? 1 : 0;
      inner += 1;
    }
  }
  std::vector<std::size_t> size(mesh.triangles.size());
  for (std::size_t t = 0; t < size.size(); ++t) ++size[parts.find(t)];
  double small = 0;
  for (const std::size_t s : size) {
    quality.parts += s > 0 ? 1 : 0;
    small += s < 100 ? static_cast<double>(s) : 0;
  }
  quality.flakes = 100 * small / static_cast<double>(mesh.triangles.size());
  quality.folds = inner > 0 ? 100 * folds / inner : 0;
  judge_boundary(mesh, std::move(next), spacing, quality);
}

inline double high_quantile(std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<long>(0.95 * static_cast<double>(values.size()));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// MeshQuality::shading.
inline double judge_shading(const TriangleMesh& mesh, const TriangleMesh& truth, const measure::TriangleBvh& truth_tree,
                            double spacing) {
  std::vector<double> tilts;
  for (std::size_t v = 0; v < mesh.normals.size(); ++v) {
    const auto nearest = truth_tree.nearest(mesh.positions[v]);
    if (nearest.distance > 3 * spacing) continue;
    const double tilt = degrees_between(to_double(mesh.normals[v]), face_normal(truth, nearest.triangle));
    tilts.push_back(std::min(tilt, 180 - tilt));
  }
  return high_quantile(tilts);
}

}  // namespace quality_detail

/// Of a mesh of the scan of the truth.
inline MeshQuality judge_mesh(const TriangleMesh& raw, const TriangleMesh& truth, const SceneScan& scan) {
  constexpr std::size_t kSamples = 40000;
  const double spacing = scan.spacing;
  const TriangleMesh mesh = quality_detail::welded(raw);
  MeshQuality q;
  q.coincident = static_cast<double>(raw.positions.size() - mesh.positions.size());
  quality_detail::judge_shape(mesh, spacing, q);

  const measure::TriangleBvh mesh_tree(mesh), truth_tree(truth);
  const NearPoints seen(scan.seen, 3 * spacing);
  const AreaSampler mesh_sampler(mesh), truth_sampler(truth);
  CounterRng random(1, 1);
  double squares = 0, close = 0;
  std::vector<double> tilts;
  for (std::size_t i = 0; i < kSamples; ++i) {
    const double share = (static_cast<double>(i) + random.uniform()) / kSamples, v = random.uniform();
    const SurfacePoint place = mesh_sampler.at(share, v, random.uniform());
    const Vec3 p = position_at(mesh, place);
    const auto nearest = truth_tree.nearest(p);
    const double tilt = quality_detail::degrees_between(quality_detail::face_normal(mesh, place.triangle),
                                                        quality_detail::face_normal(truth, nearest.triangle));
    squares += nearest.distance * nearest.distance;
    close += nearest.distance < 2 * spacing ? 1 : 0;
    q.flipped += tilt > 90 ? 100.0 / kSamples : 0;
    q.invented += seen.any_near(p) ? 0 : 100.0 / kSamples;
    if (nearest.distance < 3 * spacing) tilts.push_back(std::min(tilt, 180 - tilt));
  }
  q.error = std::sqrt(squares / kSamples) / spacing;
  q.normals = quality_detail::high_quantile(tilts);
  q.shading = quality_detail::judge_shading(raw, truth, truth_tree, spacing);
  const auto far_share = [&](const std::vector<Vec3>& places) {
    const auto far =
        std::count_if(places.begin(), places.end(), [&](const Vec3& p) { return mesh_tree.distance(p) > 2 * spacing; });
    return static_cast<double>(far) / static_cast<double>(places.size());
  };
  q.missing = 100 * far_share(scan.seen);
  const double covered = (1 - far_share(scan.places)) * truth_sampler.total_area();
  q.layers = close / kSamples * mesh_sampler.total_area() / covered;
  return q;
}

}  // namespace lamina::test::scenes

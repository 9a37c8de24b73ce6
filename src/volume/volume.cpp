#include "lamina/volume.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/output_file.h"
#include "base/run.h"
#include "lamina/error.h"
#include "measure/edge_table.h"
#include "meshes/vec3.h"
#include "vdb/vdb_file.h"
#include "volume/volume_data.h"

namespace lamina {
namespace {

using namespace meshes;

[[noreturn]] void wrong_usage(const std::string& message) {
  throw Error(ExitCode::usage, message);
}

void check_settings(const VolumeSettings& s) {
  if (!(s.voxel >= 0 && std::isfinite(s.voxel)))
    wrong_usage("--voxelsize must be a positive length, or 0 for the mean edge");
  if (!(s.band >= 1 && s.band <= 1000)) wrong_usage("--halfbandvoxels must be in 1..1000 voxels");
  if (s.name.empty() || s.name == "Cd") wrong_usage("--name must be a word other than Cd, which is the colours' name");
}

struct Edges {
  std::uint64_t boundary = 0;
  double mean_length = 0;
};

Edges look_at_edges(const TriangleMesh& mesh) {
  Edges edges;
  double sum = 0;
  std::uint64_t count = 0;
  measure::EdgeTable(mesh).for_each_edge([&](std::span<const measure::Side> sides) {
    const std::uint32_t corner = sides[0].corner, next = sides[0].next_corner();
    const auto at = [&](std::uint32_t c) { return mesh.positions[mesh.triangles[c / 3][c % 3]]; };
    sum += norm(at(next) - at(corner));
    ++count;
    edges.boundary += sides.size() == 1;
  });
  if (count > 0) edges.mean_length = sum / static_cast<double>(count);
  return edges;
}

double area_of(const TriangleMesh& mesh) {
  double area = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) area += triangle_area(mesh, t);
  return area;
}

struct Bounds {
  Vec3 low, high;
  [[nodiscard]] double extent() const { return std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]}); }
  [[nodiscard]] double diagonal() const { return norm(high - low); }
};

Bounds bounds_of(const TriangleMesh& mesh) {
  Bounds b{mesh.positions[0], mesh.positions[0]};
  for (const Vec3& p : mesh.positions)
    for (std::size_t k = 0; k < 3; ++k) b.low[k] = std::min(b.low[k], p[k]), b.high[k] = std::max(b.high[k], p[k]);
  return b;
}

/// Voxels lie on multiples of their edge. OpenVDB's converter judges sides in floats: voxel numbers are counted from
/// the origin only as long as these can tell them apart, else from the middle of the mesh.
openvdb::math::Transform::Ptr choose_transform(const Bounds& bounds, double voxel, double band) {
  constexpr double kFromOrigin = 1 << 20, kLargest = 1 << 30;
  const auto& [low, high] = bounds;
  const double extent = bounds.extent();
  double farthest = 0;
  for (std::size_t k = 0; k < 3; ++k) farthest = std::max({farthest, -low[k], high[k]});
  if (voxel > bounds.diagonal())
    wrong_usage(
        fmt::format("--voxelsize {:g}: larger than the whole mesh, which spans {:g}", voxel, bounds.diagonal()));
  if (0.5 * extent / voxel + band > kLargest || farthest / voxel > kLargest * kFromOrigin)
    wrong_usage(fmt::format("--voxelsize {:g}: too small for a mesh of this size ({:g}, coordinates up to {:g})", voxel,
                            extent, farthest));
  // OpenVDB takes a smaller voxel for a singular transform.
  constexpr double kSmallest = 1.5e-5;
  if (voxel < kSmallest) {
    wrong_usage(fmt::format("--voxelsize {:g}: OpenVDB holds none below {:g}; scale the mesh up, or use a larger one",
                            voxel, kSmallest));
  }
  auto transform = openvdb::math::Transform::createLinearTransform(voxel);
  if (farthest / voxel <= kFromOrigin) return transform;
  openvdb::Vec3d middle;
  for (int k = 0; k < 3; ++k) {
    const auto i = static_cast<std::size_t>(k);
    middle[k] = voxel * std::round((low[i] + 0.5 * (high[i] - low[i])) / voxel);
  }
  transform->postTranslate(middle);
  return transform;
}

/// Voxels of a band around the mesh, half as wide as `width`: as of a convex body, and no more than the box around it.
double voxels_within(const Bounds& bounds, double area, double width, double voxel) {
  constexpr double kPi = 3.14159265358979;
  const double around = 2 * area * width + kPi * bounds.extent() * width * width + 4 * kPi / 3 * width * width * width;
  double box = 1;
  for (std::size_t k = 0; k < 3; ++k) box *= bounds.high[k] - bounds.low[k] + 2 * width;
  return std::min(around, box) / (voxel * voxel * voxel);
}

/// Bytes in leaves: the band's volume at four bytes a voxel for the distance, four for OpenVDB's nearest triangles and
/// twelve for the colour; leaves are about half full.
void check_memory(const TriangleMesh& mesh, const Bounds& bounds, const VolumeSettings& s, double voxel, bool colours,
                  const RunContext& run) {
  const std::uint64_t most = run.max_memory > 0 ? run.max_memory : machine_memory();
  if (most == 0) return;
  const double area = area_of(mesh);
  const auto needs = [&](double edge, double band) {
    return 2 * voxels_within(bounds, area, (band + 1) * edge, edge) * (colours ? 20 : 8) +
           60.0 * static_cast<double>(mesh.triangles.size());
  };
  const auto fits = [&](double edge, double band) { return needs(edge, band) <= static_cast<double>(most); };
  if (fits(voxel, s.band)) return;
  // The least change in steps of a tenth that would do.
  double edge = voxel, band = s.band;
  while (!fits(edge, s.band) && edge < bounds.extent()) edge *= 1.1;
  while (!fits(voxel, band) && band > 1) band = std::max(1.0, std::floor(0.9 * band));
  std::string remedy;
  if (edge < bounds.extent()) remedy = fmt::format("with --voxelsize {:.2g} it would fit", 1.05 * edge);
  if (fits(voxel, band) && band >= 3)
    remedy += fmt::format("{}with --halfbandvoxels {:g} it would fit", remedy.empty() ? "" : ", or ", band);
  if (remedy.empty()) remedy = "simplify the mesh";
  throw Error(ExitCode::budget,
              fmt::format("a voxel of {:g} and a band of {:g} need about {:.0f} MB, {} {:.0f} MB; {}", voxel, s.band,
                          needs(voxel, s.band) / 1e6, run.max_memory > 0 ? "--max-memory allows" : "the machine has",
                          static_cast<double>(most) / 1e6, remedy));
}

/// What a 16-bit float holds: up to 65504, steps of 2^-24 near zero.
void check_half(double voxel, double band, const RunContext& run) {
  if (voxel * band > 65504) wrong_usage(fmt::format("--half cannot hold distances up to {:g}", voxel * band));
  if (voxel < 100 * 0x1p-24)
    run.warn(fmt::format("16-bit distances are coarse for voxels of {:g}; leave out --half", voxel));
}

bool decide_sign(const VolumeSettings& s, std::uint64_t boundary_edges, const RunContext& run) {
  if (s.sign == VolumeSign::none) return false;
  if (boundary_edges == 0) return true;
  if (s.sign == VolumeSign::inside) {
    run.warn(fmt::format("the mesh is open ({} boundary edges): what a hole wider than a voxel opens counts as outside",
                         boundary_edges));
    return true;
  }
  run.info(fmt::format("the mesh is open ({} boundary edges): distances without a sign", boundary_edges));
  return false;
}

/// Readers have checked theirs; a mesh built by hand may say anything.
void check_indices(const TriangleMesh& mesh) {
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (const auto v : mesh.triangles[t]) {
      if (static_cast<std::size_t>(v) < mesh.positions.size()) continue;
      wrong_usage(
          fmt::format("triangle {} names vertex {}, the mesh has {}; repair its indices", t, v, mesh.positions.size()));
    }
  }
}

VolumeStats convert(const TriangleMesh& mesh, const VolumeSettings& s, const std::string& path, const RunContext& run) {
  const Edges edges = look_at_edges(mesh);
  if (!(edges.mean_length > 0)) throw Error(ExitCode::empty, "the mesh has no area: all its vertices coincide");
  VolumeStats stats;
  stats.voxel = s.voxel > 0 ? s.voxel : edges.mean_length;
  stats.boundary_edges = edges.boundary;
  const Bounds bounds = bounds_of(mesh);
  const auto transform = choose_transform(bounds, stats.voxel, s.band);
  if (s.half) check_half(stats.voxel, s.band, run);
  check_memory(mesh, bounds, s, stats.voxel, s.colours, run);
  ResultFile out(path);  // an output that cannot be written is refused before the work
  stats.has_sign = decide_sign(s, edges.boundary, run);

  openvdb::initialize();
  const measure::TriangleBvh triangles(mesh);
  const auto distances = volume::distance_grid(mesh, triangles, *transform, s.band, stats.has_sign, run);
  stats.voxels = distances->activeVoxelCount();
  distances->setGridClass(stats.has_sign ? openvdb::GRID_LEVEL_SET : openvdb::GRID_UNKNOWN);
  volume::label(*distances, s.name, s.half);
  openvdb::GridCPtrVec grids{distances};
  if (const auto colours = s.colours ? volume::colour_grid(mesh, triangles, *distances) : nullptr) {
    stats.has_colours = true;
    colours->setVectorType(openvdb::VEC_INVARIANT);
    volume::label(*colours, "Cd", s.half);
    grids.push_back(colours);
  }
  if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
  const std::string bytes = volume::vdb_bytes(grids);
  out.write(bytes);
  out.commit();
  stats.bytes = bytes.size();
  return stats;
}

}  // namespace

VolumeStats write_volume(const TriangleMesh& mesh, const VolumeSettings& settings, const std::string& path,
                         const RunContext& run) {
  check_settings(settings);
  if (mesh.triangles.empty())
    throw Error(ExitCode::unreadable, "the mesh has no triangles (a point cloud? reconstruct it first)");
  if (mesh.triangles.size() > 0x7FFFFFFFu / 3)
    throw Error(ExitCode::unreadable, "meshes of more than 715,827,882 triangles are not supported");
  check_indices(mesh);
  VolumeStats stats;
  with_threads(run.threads, [&] { stats = convert(mesh, settings, path, run); });
  return stats;
}

}  // namespace lamina

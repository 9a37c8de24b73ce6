#include "reconstruct/final_vertices.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "base/vectors.h"

namespace lamina {
namespace {

struct Corner {
  const SurfaceCorner* corner;
  const std::vector<std::vector<float>>* attributes;
  std::size_t index;
};

using Vec3 = Eigen::Vector3d;

Vec3 position(const SurfaceCorner& c) {
  return Eigen::Vector3i(c.position[0], c.position[1], c.position[2]).cast<double>();
}
Vec3 to_vec(const std::array<float, 3>& v) {
  return {double{v[0]}, double{v[1]}, double{v[2]}};
}

Vec3 clustered(const SurfaceCorner& c, float chord) {
  const float shift = std::clamp(chord * c.curvature * c.cell * c.cell, -0.25F * c.cell, 0.25F * c.cell);
  return position(c) + to_vec(c.offset) + static_cast<double>(shift) * to_vec(c.normal);
}

void place_points(const ClusteredSlab& from, const Frame& frame, float chord, VertexBatch& out) {
  const FinalSlab& slab = from.slab;
  const IsoSlab& here = from.here;
  const IsoSlab* const next = from.next;
  const std::size_t n = slab.vertices.size();
  const std::size_t attributes = here.corner_attributes.size();
  for (auto* v : {&out.x, &out.y, &out.z}) resize_anew(*v, n);
  for (auto* v : {&out.nx, &out.ny, &out.nz}) resize_anew(*v, n);
  out.attributes.resize(attributes);
  for (auto& a : out.attributes) resize_anew(a, n);
  const auto look_up = [&](SlabIndex i) {
    const IsoSlab& s = i.next() ? *next : here;
    return Corner{&s.corners[i.index()], &s.corner_attributes, i.index()};
  };
  const Eigen::Matrix3d back = frame.rotation.transpose();
  tbb::parallel_for(std::size_t{0}, (n + 4095) / 4096, [&](std::size_t piece) {
    for (std::size_t i = piece * 4096; i < std::min(n, (piece + 1) * 4096); ++i) {
      const FinalVertex& v = slab.vertices[i];
      const Corner a = look_up(v.corner);
      Vec3 p;
      Vec3 normal = to_vec(a.corner->normal);
      if (v.kind == FinalVertex::Kind::isovertex) {
        const Corner b = look_up(v.other);
        const double t = v.t;
        p = (1 - t) * position(*a.corner) + t * position(*b.corner);
        // Where a corner is not trusted its point keeps to the samples, which the edge may not.
        if (a.corner->offset_from_mean < 0 || b.corner->offset_from_mean < 0)
          p = (1 - t) * clustered(*a.corner, chord) + t * clustered(*b.corner, chord);
        const Vec3 blended = (1 - t) * normal + t * to_vec(b.corner->normal);
        if (blended.squaredNorm() > 1e-12) normal = blended.normalized();
        for (std::size_t c = 0; c < attributes; ++c) {
          out.attributes[c][i] = (1 - v.t) * (*a.attributes)[c][a.index] + v.t * (*b.attributes)[c][b.index];
        }
      } else {
        p = v.kind == FinalVertex::Kind::corner ? clustered(*a.corner, chord)
                                                : Vec3(position(*a.corner) + to_vec(v.position));
        for (std::size_t c = 0; c < attributes; ++c) out.attributes[c][i] = (*a.attributes)[c][a.index];
      }
      const Vec3 world = frame.to_world(p);
      const Vec3 turned = back * normal;
      out.x[i] = world.x();
      out.y[i] = world.y();
      out.z[i] = world.z();
      out.nx[i] = static_cast<float>(turned.x());
      out.ny[i] = static_cast<float>(turned.y());
      out.nz[i] = static_cast<float>(turned.z());
    }
  });
}

void place_levels(const ClusteredSlab& from, double finest, VertexBatch& out) {
  std::vector<float>& levels = out.attributes.emplace_back();
  levels.reserve(from.slab.vertices.size());
  for (const FinalVertex& v : from.slab.vertices) {
    const IsoSlab& s = v.corner.next() ? *from.next : from.here;
    levels.push_back(static_cast<float>(std::lround(std::log2(s.corners[v.corner.index()].cell / finest))));
  }
}

void place_curvatures(const ClusteredSlab& from, double step, VertexBatch& out) {
  std::vector<float>& curvatures = out.attributes.emplace_back();
  curvatures.reserve(from.slab.vertices.size());
  const auto of = [&](SlabIndex i) { return (i.next() ? *from.next : from.here).corners[i.index()].curvature; };
  for (const FinalVertex& v : from.slab.vertices) {
    float curvature = of(v.corner);
    if (v.kind == FinalVertex::Kind::isovertex) curvature = (1 - v.t) * curvature + v.t * of(v.other);
    curvatures.push_back(static_cast<float>(static_cast<double>(curvature) / step));
  }
}

void place_overhangs(const ClusteredSlab& from, VertexBatch& out) {
  out.overhang.clear();
  out.overhang.reserve(from.slab.vertices.size());
  const auto of = [&](SlabIndex i) { return (i.next() ? *from.next : from.here).corners[i.index()].overhang; };
  for (const FinalVertex& v : from.slab.vertices) {
    float overhang = of(v.corner);
    if (v.kind == FinalVertex::Kind::isovertex) overhang = (1 - v.t) * overhang + v.t * of(v.other);
    out.overhang.push_back(overhang);
  }
}

void place_radii(const ClusteredSlab& from, const RadiusRule& rule, VertexBatch& out) {
  out.radius.clear();
  out.radius.reserve(from.slab.vertices.size());
  for (const FinalVertex& v : from.slab.vertices) {
    const IsoSlab& s = v.corner.next() ? *from.next : from.here;
    const double by_cell = rule.per_cell * static_cast<double>(s.corners[v.corner.index()].cell);
    out.radius.push_back(static_cast<float>(std::max(rule.least, by_cell)));
  }
}

}  // namespace

void place_vertices(const ClusteredSlab& slab, const Frame& frame, const VertexSettings& settings, VertexBatch& out) {
  place_points(slab, frame, settings.chord, out);
  if (settings.levels) place_levels(slab, settings.finest_cell, out);
  if (settings.curvature) place_curvatures(slab, frame.step, out);
  if (settings.filled) out.attributes.emplace_back(out.size(), 0.0F);
  if (settings.invented) out.attributes.emplace_back(out.size(), 0.0F);
  if (settings.trim > 0) place_overhangs(slab, out);
  place_radii(slab, settings.radii, out);
}

}  // namespace lamina

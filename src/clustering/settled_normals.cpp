#include "clustering/settled_normals.h"

#include <utility>

#include "meshes/settled_normal.h"

namespace lamina {

using namespace meshes;

void NormalSettler::push(MeshSlab slab) {
  Held& last = held_.emplace_back();
  last.first = pushed_;
  last.triangles.resize(slab.vertices.size());
  pushed_ += static_cast<std::uint32_t>(slab.vertices.size());
  last.mesh = std::move(slab);
  add_triangles_of_last();
  if (held_.size() > kSettleReach) settle(held_.front());
}

void NormalSettler::finish() {
  while (!held_.empty()) settle(held_.front());
}

bool NormalSettler::pop(MeshSlab& out) {
  if (ready_.empty()) return false;
  out = std::move(ready_.front());
  ready_.pop_front();
  return true;
}

void NormalSettler::add_triangles_of_last() {
  const auto slab_of = [this](std::uint32_t v) -> Held& {
    return v >= held_.back().first ? held_.back() : held_.front();
  };
  const auto position = [&](std::uint32_t v) {
    const Held& of = slab_of(v);
    const std::uint32_t i = v - of.first;
    return Vec3{of.mesh.vertices.x[i], of.mesh.vertices.y[i], of.mesh.vertices.z[i]};
  };
  for (const auto& t : held_.back().mesh.triangles) {
    const Vec3 normal = area_normal(position(t[0]), position(t[1]), position(t[2]));
    for (const std::uint32_t v : t) {
      Held& of = slab_of(v);
      Vec3& sum = of.triangles[v - of.first];
      sum = sum + normal;
    }
  }
}

void NormalSettler::settle(Held& slab) {
  VertexBatch& vertices = slab.mesh.vertices;
  vertices.fitted.resize(vertices.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    vertices.fitted[i] = {vertices.nx[i], vertices.ny[i], vertices.nz[i]};
    const auto settled = to_float(settled_normal(to_double(vertices.fitted[i]), unit(slab.triangles[i])));
    vertices.nx[i] = settled[0];
    vertices.ny[i] = settled[1];
    vertices.nz[i] = settled[2];
  }
  ready_.push_back(std::move(slab.mesh));
  held_.pop_front();
}

}  // namespace lamina

#include "volume/volume_data.h"

#include <openvdb/math/Proximity.h>
#include <openvdb/tools/ChangeBackground.h>
#include <openvdb/tools/MeshToVolume.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <cmath>

#include "lamina/error.h"
#include "meshes/colours.h"

namespace lamina::volume {
namespace {

using openvdb::Vec3d;

/// The mesh as OpenVDB's converter asks for it, in double: georeferenced coordinates lose nothing.
struct MeshAdapter {
  const TriangleMesh& mesh;
  const openvdb::math::Transform& transform;

  [[nodiscard]] std::size_t polygonCount() const { return mesh.triangles.size(); }
  [[nodiscard]] std::size_t pointCount() const { return mesh.positions.size(); }
  [[nodiscard]] static std::size_t vertexCount(std::size_t) { return 3; }
  void getIndexSpacePoint(std::size_t n, std::size_t v, Vec3d& position) const {
    position = transform.worldToIndex(Vec3d(mesh.positions[mesh.triangles[n][v]].data()));
  }
};

struct Interrupter : openvdb::util::NullInterrupter {
  const RunContext& run;
  explicit Interrupter(const RunContext& context) : run(context) {}
  bool wasInterrupted(int /*percent*/ = -1) override { return run.cancelled(); }
};

meshes::Vec3 world(const openvdb::math::Transform& transform, const openvdb::Coord& voxel) {
  const Vec3d p = transform.indexToWorld(voxel);
  return {p.x(), p.y(), p.z()};
}

/// The nearest triangle, where a distance to some triangle is known from a float.
measure::NearestTriangle nearest(const measure::TriangleBvh& triangles, const meshes::Vec3& p, float known) {
  const double bound = 1.00001 * std::abs(static_cast<double>(known));
  const measure::NearestTriangle found = triangles.nearest(p, bound);
  // Where the float was a little short nothing is found below it.
  return found.distance < bound ? found : triangles.nearest(p);
}

void stop_when_cancelled(const RunContext& run) {
  if (run.cancelled()) throw Error(ExitCode::internal, "cancelled");
}

}  // namespace

openvdb::FloatGrid::Ptr distance_grid(const TriangleMesh& mesh, const measure::TriangleBvh& triangles,
                                      const openvdb::math::Transform& transform, double band, bool has_sign,
                                      const RunContext& run) {
  using namespace openvdb;
  Interrupter interrupter(run);
  // OpenVDB tells which voxels lie in the band and which side they are on. Its distances are exact next to the surface
  // only; farther out they are taken from the triangles that neighbours found nearest, so what it finds is a voxel
  // wider than asked for, measured anew and cut to size. Renormalising would blur what is exact.
  const auto wide = static_cast<float>(band + 1);
  const int flags = (has_sign ? 0 : tools::UNSIGNED_DISTANCE_FIELD) | tools::DISABLE_RENORMALIZATION;
  auto grid = tools::meshToVolume<FloatGrid>(interrupter, MeshAdapter{mesh, transform}, transform, wide, wide, flags);
  stop_when_cancelled(run);
  const auto limit = static_cast<float>(band * transform.voxelSize()[0]);
  tree::LeafManager<FloatTree> leaves(grid->tree());
  leaves.foreach ([&](FloatTree::LeafNodeType& leaf, std::size_t) {
    if (run.cancelled()) return;
    for (auto value = leaf.beginValueOn(); value; ++value) {
      const auto distance = static_cast<float>(nearest(triangles, world(transform, value.getCoord()), *value).distance);
      const bool inside = *value < 0;
      if (distance >= limit) value.setValueOff();
      value.setValue(std::copysign(std::min(distance, limit), inside ? -1.0F : 1.0F));
    }
  });
  stop_when_cancelled(run);
  tools::changeLevelSetBackground(grid->tree(), limit);
  tools::pruneLevelSet(grid->tree());
  return grid;
}

openvdb::Vec3SGrid::Ptr colour_grid(const TriangleMesh& mesh, const measure::TriangleBvh& triangles,
                                    const openvdb::FloatGrid& distances) {
  using namespace openvdb;
  const auto columns = meshes::find_colours(mesh);
  if (!columns) return nullptr;
  const math::Transform& transform = distances.transform();
  auto tree = std::make_shared<Vec3STree>(distances.tree(), Vec3s(0), TopologyCopy());
  tree::LeafManager<Vec3STree> leaves(*tree);
  leaves.foreach ([&](Vec3STree::LeafNodeType& leaf, std::size_t) {
    for (auto value = leaf.beginValueOn(); value; ++value) {
      const meshes::Vec3 p = world(transform, value.getCoord());
      const float distance = distances.tree().getValue(value.getCoord());
      const auto& corner = mesh.triangles[nearest(triangles, p, distance).triangle];
      Vec3d weights;
      const auto at = [&](int k) { return Vec3d(mesh.positions[corner[static_cast<std::size_t>(k)]].data()); };
      math::closestPointOnTriangleToPoint(at(0), at(1), at(2), Vec3d(p.data()), weights);
      Vec3d colour(0.0);
      for (int k = 0; k < 3; ++k) {
        const auto c = columns->at(mesh, corner[static_cast<std::size_t>(k)]);
        colour += weights[k] * Vec3d(c[0], c[1], c[2]) / 255.0;
      }
      value.setValue(Vec3s(colour));
    }
  });
  auto grid = Vec3SGrid::create(tree);
  grid->setTransform(transform.copy());
  return grid;
}

}  // namespace lamina::volume

#include "volume/volume_data.h"

#include <fmt/format.h>
#include <openvdb/math/Proximity.h>
#include <openvdb/tools/ChangeBackground.h>
#include <openvdb/tools/MeshToVolume.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tools/VolumeToMesh.h>
#include <openvdb/tree/LeafManager.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "base/run.h"
#include "lamina/error.h"
#include "meshes/formats.h"
#include "vdb/vdb_file.h"

namespace lamina {
namespace volume {
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

}  // namespace volume

namespace {

using openvdb::GridBase;
using openvdb::Vec3d;

/// How well a grid serves as the level set nobody named; 0: not at all.
int level_set_fitness(const GridBase& grid, bool /*named*/) {
  if (!volume::is_scalar(grid)) return 0;
  const openvdb::GridClass kind = grid.getGridClass();
  if (kind == openvdb::GRID_LEVEL_SET) return grid.getName() == "surface" ? 4 : 3;
  return kind == openvdb::GRID_UNKNOWN ? 1 : 0;
}

double squared_distance(const TriangleMesh& mesh, std::uint32_t a, std::uint32_t b) {
  double sum = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double d = mesh.positions[a][k] - mesh.positions[b][k];
    sum += d * d;
  }
  return sum;
}

/// OpenVDB winds its polygons clockwise seen from outside; a mirroring transform turns them round again.
class Triangulator {
 public:
  Triangulator(TriangleMesh& mesh, bool mirrored) : mesh_(mesh), mirrored_(mirrored) {}
  void triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    if (a == b || b == c || c == a) return;
    if (mirrored_) std::swap(b, c);
    mesh_.triangles.push_back({a, c, b});
  }
  void quad(const openvdb::Vec4I& q) {
    if (squared_distance(mesh_, q[0], q[2]) <= squared_distance(mesh_, q[1], q[3])) {
      triangle(q[0], q[1], q[2]);
      triangle(q[0], q[2], q[3]);
    } else {
      triangle(q[0], q[1], q[3]);
      triangle(q[1], q[2], q[3]);
    }
  }

 private:
  TriangleMesh& mesh_;
  bool mirrored_;
};

void drop_unused(TriangleMesh& mesh) {
  constexpr std::uint32_t kNone = ~std::uint32_t{0};
  std::vector<std::uint32_t> number(mesh.positions.size(), kNone);
  for (const auto& t : mesh.triangles)
    for (const std::uint32_t v : t) number[v] = 0;
  std::uint32_t next = 0;
  for (std::size_t v = 0; v < number.size(); ++v) {
    if (number[v] == kNone) continue;
    mesh.positions[next] = mesh.positions[v];
    number[v] = next++;
  }
  mesh.positions.resize(next);
  for (auto& t : mesh.triangles)
    for (std::uint32_t& v : t) v = number[v];
}

TriangleMesh mesh_grid(const openvdb::FloatGrid& grid, const MeshingSettings& s) {
  // OpenVDB gives positions as floats: they are taken in voxels from the corner of the band, and go to the world here.
  const Vec3d corner = grid.evalActiveVoxelBoundingBox().getStart().asVec3d();
  auto local = openvdb::math::Transform::createLinearTransform();
  local->postTranslate(-corner);
  const openvdb::FloatGrid::ConstPtr moved = grid.copyReplacingTransform(local);
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec3I> triangles;
  std::vector<openvdb::Vec4I> quads;
  openvdb::tools::volumeToMesh(*moved, points, triangles, quads, s.isovalue, s.adaptivity);

  TriangleMesh mesh;
  mesh.positions.reserve(points.size());
  for (const openvdb::Vec3s& p : points) {
    const Vec3d world = grid.transform().indexToWorld(Vec3d(p) + corner);
    mesh.positions.push_back({world[0], world[1], world[2]});
  }
  const bool mirrored = grid.transform().baseMap()->determinant() < 0;
  Triangulator out(mesh, mirrored);
  for (const auto& q : quads) out.quad(q);
  for (const auto& t : triangles) out.triangle(t[0], t[1], t[2]);
  drop_unused(mesh);
  return mesh;
}

}  // namespace

LevelSet::LevelSet(std::shared_ptr<const Data> data) : data_(std::move(data)) {}
const std::string& LevelSet::name() const {
  return data_->name;
}
double LevelSet::voxel() const {
  const openvdb::Vec3d v = data_->grid->voxelSize();
  return std::min({v[0], v[1], v[2]});
}
double LevelSet::band() const {
  return data_->grid->background();
}
bool LevelSet::open() const {
  return data_->open;
}

LevelSet read_level_set(const std::string& path, const std::string& name) {
  const volume::VdbFile file = volume::read_vdb(path);
  const GridBase::Ptr grid = volume::choose_grid(path, file.grids, name, "level set", level_set_fitness);
  auto data = std::make_shared<LevelSet::Data>();
  data->name = grid->getName();
  data->path = path;
  data->open = volume::is_open(*grid);
  data->grid = volume::as_float(grid);
  data->colours = volume::colours_of(file.grids);
  if (!(data->grid->background() > 0)) {
    throw Error(ExitCode::unreadable, fmt::format("{}: grid {} is no level set: outside its band stands {}, not the "
                                                  "band's width",
                                                  path, data->name, data->grid->background()));
  }
  return LevelSet(std::move(data));
}

TriangleMesh mesh_level_set(const LevelSet& level_set, const MeshingSettings& settings, const RunContext& run) {
  if (!(settings.adaptivity >= 0 && settings.adaptivity <= 1))
    throw Error(ExitCode::usage, "--adaptivity must be in 0..1");
  if (!(std::abs(settings.isovalue) < level_set.band())) {
    throw Error(ExitCode::usage,
                fmt::format("--isovalue must lie inside the band: between -{0:g} and {0:g}", level_set.band()));
  }
  TriangleMesh mesh;
  with_threads(run.threads, [&] { mesh = mesh_grid(*level_set.data().grid, settings); });
  if (mesh.triangles.empty()) {
    const std::string& path = level_set.data().path;
    throw Error(ExitCode::empty, fmt::format("{}{}grid {} has no surface at distance {:g}", path,
                                             path.empty() ? "" : ": ", level_set.name(), settings.isovalue));
  }
  return mesh;
}

}  // namespace lamina

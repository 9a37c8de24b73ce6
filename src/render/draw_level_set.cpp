#include <openvdb/openvdb.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/RayIntersector.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "render/draw.h"
#include "render/shade.h"
#include "volume/level_set_data.h"

namespace lamina::render_detail {
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using Ray = openvdb::math::Ray<double>;
using Sampler = openvdb::tools::BoxSampler;

constexpr double kStep = 0.25;       // voxels to look around a crossing, and to go on after one that is none
constexpr double kDifference = 1.0;  // voxels to either side of a gradient's difference

Vec3d to_vdb(const Eigen::Vector3d& v) {
  return {v[0], v[1], v[2]};
}

// OpenVDB's ray intersector compares distances with the voxel's size and wants cubes. Rays are given in index space,
// where any linear transform's voxels are cubes; the largest edge bounds the distances between neighbours.
FloatGrid::ConstPtr in_index_space(const FloatGrid& grid) {
  const Vec3d edges = grid.voxelSize();
  const double largest = std::max({edges[0], edges[1], edges[2]});
  const auto moved = grid.copyReplacingTransform(openvdb::math::Transform::createLinearTransform(largest));
  openvdb::MetaMap labels(*moved);
  labels.insertMeta(openvdb::GridBase::META_GRID_CLASS,
                    openvdb::StringMetadata(openvdb::GridBase::gridClassToString(openvdb::GRID_LEVEL_SET)));
  return moved->copyReplacingMetadata(labels);
}

// Casts rays on one thread: intersector and accessors remember the nodes they were in.
class Caster {
 public:
  Caster(const FloatGrid& grid, const LevelSet::Data& level_set)
      : intersector_(grid), values_(grid.tree()), data_(level_set) {
    if (level_set.colours) colours_.emplace(level_set.colours->tree());
  }

  // The first point of the surface along the ray, index space. Where the band ends, at the rim of an open surface,
  // distances jump to the background's: a change of sign there, or between there and the band, is no surface.
  bool hit(Ray ray, Vec3d& at) const {
    double time = 0;
    while (intersector_.intersectsIS(ray, at, time)) {
      if (!data_.open || crosses(ray, time, at)) return true;
      ray.setMinTime(time + kStep);
      if (!(ray.t0() < ray.t1())) break;
    }
    return false;
  }

  // The direction in which distances grow, in world coordinates; zero where there is none.
  Vec3d normal(const Vec3d& at) const {
    Vec3d gradient(0);
    for (int axis = 0; axis < 3; ++axis) {
      double above = 0, below = 0;
      Vec3d p = at;
      double& coordinate = p[axis];
      coordinate += kDifference;
      const bool up = !data_.open || known(p);
      if (up) above = Sampler::sample(values_, p);
      coordinate -= 2 * kDifference;
      const bool down = !data_.open || known(p);
      if (down) below = Sampler::sample(values_, p);
      // At the rim one side alone serves: on the surface itself the distance is 0.
      gradient[axis] = (above - below) * (up && down ? 1 : 2);
    }
    Vec3d out = data_.grid->transform().baseMap()->applyIJT(gradient);
    return out.normalize() ? out : Vec3d(0);
  }

  std::optional<Rgb> colour(const Vec3d& world) const {
    if (!colours_) return std::nullopt;
    const openvdb::Vec3s c = Sampler::sample(*colours_, data_.colours->transform().worldToIndex(world));
    Rgb out;
    for (std::size_t i = 0; i < 3; ++i) {
      const float byte = 255 * c[static_cast<int>(i)];
      out[i] = decode(static_cast<std::uint8_t>(byte > 0 ? std::min(byte, 255.0F) + 0.5F : 0.0F));
    }
    return out;
  }

 private:
  // The distance changes its sign next to a place on the ray, in the band; `at` is where.
  bool crosses(const Ray& ray, double time, Vec3d& at) const {
    const Vec3d before = ray(time - kStep), behind = ray(time + kStep);
    if (!known(before) || !known(behind)) return false;
    const double first = Sampler::sample(values_, before), last = Sampler::sample(values_, behind);
    if ((first < 0) == (last < 0)) return false;
    at = before + first / (first - last) * (behind - before);
    return true;
  }

  // All eight voxels around the place are in the band.
  bool known(const Vec3d& at) const {
    const Coord corner = Coord::floor(at);
    for (int i = 0; i < 8; ++i) {
      if (!values_.isValueOn(corner.offsetBy(i & 1, i >> 1 & 1, i >> 2))) return false;
    }
    return true;
  }

  openvdb::tools::LevelSetRayIntersector<FloatGrid> intersector_;
  FloatGrid::ConstAccessor values_;
  std::optional<openvdb::Vec3SGrid::ConstAccessor> colours_;
  const LevelSet::Data& data_;
};

}  // namespace

void visit_surface(const LevelSet& level_set, const std::function<void(const std::array<double, 3>&)>& visit) {
  const FloatGrid& grid = *level_set.data().grid;
  const openvdb::Vec3d edges = grid.voxelSize();
  const double voxel = std::max({edges[0], edges[1], edges[2]});
  for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf) {
    for (auto value = leaf->cbeginValueOn(); value; ++value) {
      if (std::abs(static_cast<double>(*value)) > voxel) continue;
      const Vec3d world = grid.transform().indexToWorld(value.getCoord());
      visit({world[0], world[1], world[2]});
    }
  }
}

void draw_level_set(const LevelSet& level_set, const RenderSettings& settings, const View& view, Canvas& canvas) {
  const LevelSet::Data& data = level_set.data();
  const FloatGrid::ConstPtr grid = in_index_space(*data.grid);
  const openvdb::math::Transform& transform = data.grid->transform();
  // Rays begin and end outside the sphere around the grid.
  const openvdb::CoordBBox box = data.grid->evalActiveVoxelBoundingBox();
  const Vec3d low = transform.indexToWorld(box.min()), high = transform.indexToWorld(box.max());
  const Vec3d ball = 0.5 * (low + high);
  const Vec3d toward = to_vdb(view.toward);
  double reach = 0;
  for (int i = 0; i < 8; ++i) {
    const Coord corner((i & 1) != 0 ? box.max()[0] + 1 : box.min()[0] - 1,
                       (i & 2) != 0 ? box.max()[1] + 1 : box.min()[1] - 1,
                       (i & 4) != 0 ? box.max()[2] + 1 : box.min()[2] - 1);
    reach = std::max(reach, (transform.indexToWorld(corner) - ball).length());
  }
  const double farthest = toward.dot(ball - to_vdb(view.centre)) + reach;
  const double start = std::min<double>(farthest, view.near);
  const double length = start - farthest + 2 * reach;
  if (!(length > 0)) return;
  const Caster prototype(*grid, data);
  tbb::parallel_for(tbb::blocked_range<int>(0, view.tile.height), [&](const tbb::blocked_range<int>& rows) {
    const Caster caster = prototype;
    for (int row = rows.begin(); row < rows.end(); ++row) {
      for (int column = 0; column < view.tile.width; ++column) {
        const double right = (column + 0.5 - 0.5 * view.tile.width) / view.scale;
        const double up = (0.5 * view.tile.height - row - 0.5) / view.scale;
        const Vec3d begin = to_vdb(view.centre + right * view.right + up * view.up + start * view.toward);
        const Vec3d from = transform.worldToIndex(begin), to = transform.worldToIndex(begin - length * toward);
        const double steps = (to - from).length();
        Vec3d at;
        if (!caster.hit(Ray(from, (to - from) / steps, 0, steps), at)) continue;
        const Vec3d world = transform.indexToWorld(at);
        const auto depth = static_cast<float>(toward.dot(world - to_vdb(view.centre)));
        const int x = view.tile.x + column, y = view.tile.y + row;
        if (!canvas.visible(x, y, depth)) continue;
        const Vec3d n = caster.normal(at);
        const std::array<float, 3> outward{static_cast<float>(n[0]), static_cast<float>(n[1]),
                                           static_cast<float>(n[2])};
        Rgb base = kClay;
        if (settings.colour == ColourMode::normals) base = normal_colour(outward);
        if (settings.colour == ColourMode::automatic) base = caster.colour(world).value_or(kClay);
        Eigen::Vector3f facing = view.direction(outward);
        const bool back = facing.z() < 0;
        if (back) facing = -facing;
        if (!(facing.norm() > 0)) facing = Eigen::Vector3f::UnitZ();
        canvas.set(x, y, depth, lit(base, facing, back));
      }
    }
  });
}

}  // namespace lamina::render_detail

#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/RayIntersector.h>

#include <algorithm>
#include <cmath>

#include "render/canvas.h"
#include "render/ray_field.h"
#include "vdb/grids.h"
#include "volume/volume_data.h"

namespace lamina::render_detail {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using Ray = openvdb::math::Ray<double>;
using Sampler = openvdb::tools::BoxSampler;
using Intersector = openvdb::tools::VolumeRayIntersector<FloatGrid>;

/// Density 1 over the picture's subject takes so much light, as an exponent: a thirty-sixth of the way lets a third
/// through.
constexpr double kDepthOfAll = 36;
constexpr double kOpaque = 0.995;

/// Light that is gathered along a ray from the viewer on.
struct Gathered {
  Rgb light{};
  double opacity = 0, depth = 0;
};

/// Casts rays on one thread: intersector and accessors remember the nodes they were in.
class Marcher {
 public:
  Marcher(const FogVolume::Data& fog, const FloatGrid& cubes, const RenderSettings& settings, const View& view)
      : intersector_(cubes, 1),
        values_(fog.grid->tree()),
        colours_(fog.colours),
        fog_(fog),
        settings_(settings),
        view_(view) {
    const CoordBBox box = fog.grid->evalActiveVoxelBoundingBox();
    const openvdb::math::Transform& transform = fog.grid->transform();
    const double diagonal = (transform.indexToWorld(box.max()) - transform.indexToWorld(box.min())).length();
    extinction_ = kDepthOfAll / std::max(diagonal, fog.grid->voxelSize().length());
  }

  /// `world_step`: of one voxel along the ray.
  Gathered operator()(const Ray& ray, double world_step) {
    Gathered out;
    if (!intersector_.setIndexRay(ray)) return out;
    double begin = 0, end = 0;
    while (out.opacity < kOpaque && intersector_.march(begin, end)) {
      for (double time = begin + 0.5; time < end + 0.5 && out.opacity < kOpaque; ++time) {
        const double step = std::min(1.0, end - time + 0.5);
        const Vec3d at = ray(time);
        const double density = Sampler::sample(values_, at);
        if (!(density > 0)) continue;
        const double share = (1 - out.opacity) * (1 - std::exp(-extinction_ * density * step * world_step));
        constexpr double kSeen = 1.0 / 1024;
        if (share > kSeen) {
          const Rgb colour = shaded(at);
          for (std::size_t c = 0; c < 3; ++c) out.light[c] += static_cast<float>(share) * colour[c];
        }
        if (out.opacity < 0.5) out.depth = time;
        out.opacity += share;
      }
    }
    return out;
  }

 private:
  Rgb shaded(const Vec3d& at) const {
    Vec3d outward(0);
    for (int axis = 0; axis < 3; ++axis) {
      Vec3d beside = at;
      beside[axis] -= 1;
      outward[axis] = Sampler::sample(values_, beside);
      beside[axis] += 2;
      outward[axis] -= Sampler::sample(values_, beside);
    }
    outward = fog_.grid->transform().baseMap()->applyIJT(outward);
    const bool known = outward.normalize();
    const std::array<float, 3> n{static_cast<float>(outward[0]), static_cast<float>(outward[1]),
                                 static_cast<float>(outward[2])};
    Rgb base = kClay;
    if (settings_.colour == ColourMode::normals) base = normal_colour(n);
    if (settings_.colour == ColourMode::automatic)
      base = colours_.at(fog_.grid->transform().indexToWorld(at)).value_or(kClay);
    // Where the density is even, light comes from everywhere.
    Eigen::Vector3f facing = known ? view_.direction(n) : Eigen::Vector3f(0, 0, 1);
    facing.z() = std::abs(facing.z());
    return lit(base, facing, false);
  }

  Intersector intersector_;
  FloatGrid::ConstAccessor values_;
  GridColours colours_;
  const FogVolume::Data& fog_;
  const RenderSettings& settings_;
  const View& view_;
  double extinction_ = 0;
};

}  // namespace

void visit_fog(const FogVolume& fog, const std::function<void(const std::array<double, 3>&)>& visit) {
  const FloatGrid& grid = *fog.data().grid;
  // Between the last voxel and the one beside it the fog fades.
  const auto visit_box = [&](CoordBBox box) {
    box.expand(1);
    for (int i = 0; i < 8; ++i) {
      const Coord corner((i & 1) != 0 ? box.max()[0] : box.min()[0], (i & 2) != 0 ? box.max()[1] : box.min()[1],
                         (i & 4) != 0 ? box.max()[2] : box.min()[2]);
      const Vec3d world = grid.transform().indexToWorld(corner);
      visit({world[0], world[1], world[2]});
    }
  };
  for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf) {
    CoordBBox box;
    leaf->evalActiveBoundingBox(box);
    if (!box.empty()) visit_box(box);
  }
  auto tile = grid.tree().cbeginValueOn();
  tile.setMaxDepth(openvdb::FloatTree::ValueOnCIter::LEAF_DEPTH - 1);
  for (; tile; ++tile) {
    CoordBBox box;
    tile.getBoundingBox(box);
    visit_box(box);
  }
}

void draw_fog(const FogVolume& fog, const RenderSettings& settings, const View& view, Canvas& canvas) {
  const FogVolume::Data& data = fog.data();
  // OpenVDB's intersector wants cubic voxels; rays are given in index space, where all are.
  const FloatGrid::ConstPtr cubes =
      data.grid->copyReplacingTransform(openvdb::math::Transform::createLinearTransform(1.0));
  const RayField field(*data.grid, view);
  if (!field.any()) return;
  field.cast(Marcher(data, *cubes, settings, view), [&](Marcher& march, const PixelRay& r) {
    const double least = openvdb::math::Delta<double>::value();
    if (!(r.steps > 2 * least)) return;
    const Gathered g = march(Ray(r.from, r.direction, least, r.steps), field.length() / r.steps);
    if (!(g.opacity > 0)) return;
    const auto depth = static_cast<float>(field.start() - g.depth * field.length() / r.steps);
    if (canvas.visible(r.x, r.y, depth)) canvas.blend(r.x, r.y, depth, g.light, static_cast<float>(g.opacity));
  });
}

}  // namespace lamina::render_detail

#include <openvdb/openvdb.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/RayIntersector.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "render/draw.h"
#include "render/shade.h"
#include "volume/fog_data.h"

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

Vec3d to_vdb(const Eigen::Vector3d& v) {
  return {v[0], v[1], v[2]};
}

/// Light that is gathered along a ray from the viewer on.
struct Gathered {
  Rgb light{};
  double opacity = 0, depth = 0;
};

/// Casts rays on one thread: intersector and accessors remember the nodes they were in.
class Marcher {
 public:
  Marcher(const FogVolume::Data& fog, const FloatGrid& cubes, const RenderSettings& settings, const View& view)
      : intersector_(cubes, 1), values_(fog.grid->tree()), fog_(fog), settings_(settings), view_(view) {
    if (fog.colours) colours_.emplace(fog.colours->tree());
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
    if (settings_.colour == ColourMode::automatic && colours_) base = colour(at);
    // Where the density is even, light comes from everywhere.
    Eigen::Vector3f facing = known ? view_.direction(n) : Eigen::Vector3f(0, 0, 1);
    facing.z() = std::abs(facing.z());
    return lit(base, facing, false);
  }

  Rgb colour(const Vec3d& at) const {
    const Vec3d world = fog_.grid->transform().indexToWorld(at);
    const openvdb::Vec3s c = Sampler::sample(*colours_, fog_.colours->transform().worldToIndex(world));
    Rgb out;
    for (std::size_t i = 0; i < 3; ++i) {
      const float byte = 255 * c[static_cast<int>(i)];
      out[i] = decode(static_cast<std::uint8_t>(byte > 0 ? std::min(byte, 255.0F) + 0.5F : 0.0F));
    }
    return out;
  }

  Intersector intersector_;
  FloatGrid::ConstAccessor values_;
  std::optional<openvdb::Vec3SGrid::ConstAccessor> colours_;
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
  const openvdb::math::Transform& transform = data.grid->transform();
  const CoordBBox box = data.grid->evalActiveVoxelBoundingBox();
  const Vec3d low = transform.indexToWorld(box.min()), high = transform.indexToWorld(box.max());
  const Vec3d ball = 0.5 * (low + high), toward = to_vdb(view.toward);
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
  const Marcher prototype(data, *cubes, settings, view);
  tbb::parallel_for(tbb::blocked_range<int>(0, view.tile.height), [&](const tbb::blocked_range<int>& rows) {
    Marcher march = prototype;
    for (int row = rows.begin(); row < rows.end(); ++row) {
      for (int column = 0; column < view.tile.width; ++column) {
        const double right = (column + 0.5 - 0.5 * view.tile.width) / view.scale;
        const double up = (0.5 * view.tile.height - row - 0.5) / view.scale;
        const Vec3d begin = to_vdb(view.centre + right * view.right + up * view.up + start * view.toward);
        const Vec3d from = transform.worldToIndex(begin), to = transform.worldToIndex(begin - length * toward);
        const double steps = (to - from).length();
        if (!(steps > 2 * openvdb::math::Delta<double>::value())) continue;
        const Ray ray(from, (to - from) / steps, openvdb::math::Delta<double>::value(), steps);
        const Gathered g = march(ray, length / steps);
        if (!(g.opacity > 0)) continue;
        const auto depth = static_cast<float>(start - g.depth * length / steps);
        const int x = view.tile.x + column, y = view.tile.y + row;
        if (canvas.visible(x, y, depth)) canvas.blend(x, y, depth, g.light, static_cast<float>(g.opacity));
      }
    }
  });
}

}  // namespace lamina::render_detail

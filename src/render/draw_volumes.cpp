#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/RayIntersector.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "render/canvas.h"
#include "render/ray_field.h"
#include "vdb/grids.h"
#include "vdb/vdb_file.h"
#include "volume/volume_data.h"

namespace lamina::render_detail {

using openvdb::Coord;
using openvdb::Vec3d;

RayField::RayField(const openvdb::FloatGrid& grid, const View& view) : transform_(grid.transform()), view_(view) {
  // Rays begin and end outside the sphere around the grid.
  const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
  const Vec3d low = transform_.indexToWorld(box.min()), high = transform_.indexToWorld(box.max());
  const Vec3d ball = 0.5 * (low + high);
  double radius = 0;
  for (int i = 0; i < 8; ++i) {
    const Coord corner((i & 1) != 0 ? box.max()[0] + 1 : box.min()[0] - 1,
                       (i & 2) != 0 ? box.max()[1] + 1 : box.min()[1] - 1,
                       (i & 4) != 0 ? box.max()[2] + 1 : box.min()[2] - 1);
    radius = std::max(radius, (transform_.indexToWorld(corner) - ball).length());
  }
  const double farthest = to_vdb(view.toward).dot(ball - to_vdb(view.centre)) + radius;
  start_ = std::min<double>(farthest, view.near);
  length_ = start_ - farthest + 2 * radius;
}

PixelRay RayField::ray(int row, int column) const {
  const double right = (column + 0.5 - 0.5 * view_.tile.width) / view_.scale;
  const double up = (0.5 * view_.tile.height - row - 0.5) / view_.scale;
  const Vec3d begin = to_vdb(view_.centre + right * view_.right + up * view_.up + start_ * view_.toward);
  const Vec3d from = transform_.worldToIndex(begin);
  const Vec3d to = transform_.worldToIndex(begin - length_ * to_vdb(view_.toward));
  const double steps = (to - from).length();
  return {view_.tile.x + column, view_.tile.y + row, from, (to - from) / steps, steps};
}

GridColours::GridColours(openvdb::Vec3SGrid::ConstPtr grid) : grid_(std::move(grid)) {
  if (grid_ != nullptr) values_.emplace(grid_->tree());
}

std::optional<Rgb> GridColours::at(const openvdb::Vec3d& world) const {
  if (!values_) return std::nullopt;
  const openvdb::Vec3s c = openvdb::tools::BoxSampler::sample(*values_, grid_->transform().worldToIndex(world));
  Rgb out;
  for (std::size_t i = 0; i < 3; ++i) {
    out[i] = decode(255 * c[static_cast<int>(i)]);
  }
  return out;
}
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using Ray = openvdb::math::Ray<double>;
using Sampler = openvdb::tools::BoxSampler;

constexpr double kDifference = 1.0;  // voxels to either side of a gradient's difference

// OpenVDB's ray intersector wants a level set of cubic voxels. Rays are given in index space, where any linear
// transform's voxels are cubes.
FloatGrid::ConstPtr in_index_space(const FloatGrid& grid, bool open) {
  const Vec3d edges = grid.voxelSize();
  const double largest = std::max({edges[0], edges[1], edges[2]});
  const auto moved = grid.copyReplacingTransform(openvdb::math::Transform::createLinearTransform(largest));
  openvdb::MetaMap labels(*moved);
  labels.insertMeta(volume::kOpenMetadata, openvdb::BoolMetadata(open));
  labels.insertMeta(openvdb::GridBase::META_GRID_CLASS,
                    openvdb::StringMetadata(openvdb::GridBase::gridClassToString(openvdb::GRID_LEVEL_SET)));
  return moved->copyReplacingMetadata(labels);
}

// All eight voxels around a place are in the band.
bool in_band(const FloatGrid::ConstAccessor& values, const Vec3d& at) {
  const Coord corner = Coord::floor(at);
  for (int i = 0; i < 8; ++i) {
    if (!values.isValueOn(corner.offsetBy(i & 1, i >> 1 & 1, i >> 2))) return false;
  }
  return true;
}

// What LevelSetRayIntersector asks along a ray, in place of OpenVDB's LinearSearchImpl: that takes the band's rim,
// where an open surface's distances jump to the background's, for surface, and misses surface behind it.
class BandSearch {
 public:
  using RayT = Ray;
  BandSearch(const FloatGrid& grid, const float& /*isovalue*/) : values_(grid.tree()), open_(volume::is_open(grid)) {
    grid.tree().root().evalActiveBoundingBox(box_, false);
  }
  bool setIndexRay(const Ray& ray) {
    ray_ = ray;
    return ray_.clip(box_);
  }
  void getIndexPos(Vec3d& at) const { at = ray_(time_); }
  [[nodiscard]] double getIndexTime() const { return time_; }

 private:
  template <typename TreeT, int NodeLevel>
  friend struct openvdb::math::LevelSetHDDA;

  struct Reading {
    double time = 0, value = 0;
    bool known = false;
  };
  Reading read(double time) const {
    const Vec3d at = ray_(time);
    if (open_ && !in_band(values_, at)) return {time, 0, false};
    return {time, Sampler::sample(values_, at), true};
  }
  void setRange(double t0, double t1) {
    // OpenVDB takes no times of zero.
    const double least = openvdb::math::Delta<double>::value();
    ray_.setTimes(std::max(t0, least), std::max(t1, least));
  }
  [[nodiscard]] const Ray& ray() const { return ray_; }
  template <typename NodeT>
  bool hasNode(const Coord& at) {
    return values_.probeConstNode<NodeT>(at) != nullptr;
  }
  void init(double time) { last_ = read(time); }
  // The surface lies between the last reading and the one at `time`, where the ray leaves the voxel `at`.
  bool operator()(const Coord& at, double time) {
    if (!values_.isValueOn(at)) {
      last_ = read(time);
      return false;
    }
    const Reading next = read(time);
    const bool crossing = last_.known && next.known && (last_.value < 0) != (next.value < 0);
    if (crossing) time_ = last_.time + (time - last_.time) * last_.value / (last_.value - next.value);
    last_ = next;
    return crossing;
  }

  FloatGrid::ConstAccessor values_;
  bool open_;
  openvdb::CoordBBox box_;
  Ray ray_;
  Reading last_;
  double time_ = 0;
};

// Casts rays on one thread: intersector and accessors remember the nodes they were in.
class Caster {
 public:
  Caster(const FloatGrid& grid, const LevelSet::Data& level_set)
      : intersector_(grid), values_(grid.tree()), colours_(level_set.colours), data_(level_set) {}

  // The first point of the surface along the ray, index space.
  bool hit(const Ray& ray, Vec3d& at) {
    double time = 0;
    return intersector_.intersectsIS(ray, at, time);
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

  std::optional<Rgb> colour(const Vec3d& world) const { return colours_.at(world); }

 private:
  bool known(const Vec3d& at) const { return in_band(values_, at); }

  openvdb::tools::LevelSetRayIntersector<FloatGrid, BandSearch> intersector_;
  FloatGrid::ConstAccessor values_;
  GridColours colours_;
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
  const FloatGrid::ConstPtr grid = in_index_space(*data.grid, data.open);
  const openvdb::math::Transform& transform = data.grid->transform();
  const RayField field(*data.grid, view);
  if (!field.any()) return;
  field.cast(Caster(*grid, data), [&](Caster& caster, const PixelRay& r) {
    Vec3d at;
    if (!caster.hit(Ray(r.from, r.direction, 0, r.steps), at)) return;
    const Vec3d world = transform.indexToWorld(at);
    const auto depth = static_cast<float>(to_vdb(view.toward).dot(world - to_vdb(view.centre)));
    if (!canvas.visible(r.x, r.y, depth)) return;
    const Vec3d n = caster.normal(at);
    const std::array<float, 3> outward{static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2])};
    Rgb base = kClay;
    if (settings.colour == ColourMode::normals) base = normal_colour(outward);
    if (settings.colour == ColourMode::automatic) base = caster.colour(world).value_or(kClay);
    Eigen::Vector3f facing = view.direction(outward);
    const bool back = facing.z() < 0;
    if (back) facing = -facing;
    if (!(facing.norm() > 0)) facing = Eigen::Vector3f::UnitZ();
    canvas.set(r.x, r.y, depth, lit(base, facing, back));
  });
}

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

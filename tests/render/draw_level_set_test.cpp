// Level sets drawn by rays, against spheres whose depth is known at every sample.
#include <gtest/gtest.h>
#include <openvdb/tools/SignedFloodFill.h>

#include <cmath>
#include <functional>

#include "lamina/render.h"
#include "render/canvas.h"
#include "vdb/grids.h"
#include "volume/volume_data.h"

namespace lamina {
namespace {

using openvdb::FloatGrid;
using openvdb::Mat4R;
using openvdb::Vec3d;

constexpr double kBand = 0.15;  // three voxels of the largest edge

/// Distances to the unit sphere around `centre`; voxels that `keep` (world, from the centre) refuses are not known.
LevelSet sphere(const Mat4R& index_to_world, const Vec3d& centre,
                const std::function<bool(const Vec3d&)>& keep = nullptr) {
  openvdb::initialize();
  const FloatGrid::Ptr grid = FloatGrid::create(static_cast<float>(kBand));
  grid->setTransform(openvdb::math::Transform::createLinearTransform(index_to_world));
  const Vec3d middle = grid->transform().worldToIndex(centre);
  constexpr int kReach = 52;  // voxels, enough for the shortest edge
  auto accessor = grid->getAccessor();
  for (int x = -kReach; x <= kReach; ++x) {
    for (int y = -kReach; y <= kReach; ++y) {
      for (int z = -kReach; z <= kReach; ++z) {
        const openvdb::Coord at = openvdb::Coord::round(middle).offsetBy(x, y, z);
        const Vec3d from = grid->transform().indexToWorld(at) - centre;
        const double distance = from.length() - 1;
        if (std::abs(distance) < kBand && (!keep || keep(from))) accessor.setValueOn(at, static_cast<float>(distance));
      }
    }
  }
  if (!keep) openvdb::tools::signedFloodFill(grid->tree());
  auto data = std::make_shared<LevelSet::Data>();
  data->grid = grid;
  data->name = "surface";
  data->open = keep != nullptr;
  return LevelSet(data);
}

RenderSettings looking(double azimuth, const Vec3d& centre) {
  RenderSettings s;
  s.width = s.height = 120;
  s.supersample = 1;
  s.azimuth = azimuth;
  s.elevation = 0;
  s.zoom = RenderSettings::Zoom{{centre[0], centre[1], centre[2]}, 1.2};
  return s;
}

/// Draws, and checks every sample's depth: truth(right, up) is NaN where nothing is to be seen. Samples nearer than
/// `doubtful` to where truth jumps are passed over.
void expect_depths(const LevelSet& level_set, const RenderSettings& settings,
                   const std::function<double(double, double)>& truth, double tolerance, double doubtful) {
  using namespace render_detail;
  Canvas canvas(settings.width, settings.height);
  std::vector<View> views = make_views(settings);
  fit_views(settings, views, std::vector<Extent>(1), views);
  draw_level_set(level_set, settings, views[0], canvas);
  int seen = 0, wrong = 0;
  for (int y = 0; y < settings.height; ++y) {
    for (int x = 0; x < settings.width; ++x) {
      const double right = (x + 0.5 - 60) / views[0].scale, up = (60 - y - 0.5) / views[0].scale;
      const double depth = truth(right, up);
      bool steady = true;
      for (const double dx : {-doubtful, doubtful}) {
        for (const double dy : {-doubtful, doubtful}) {
          const double there = truth(right + dx, up + dy);
          steady = steady && std::isnan(there) == std::isnan(depth) && !(std::abs(there - depth) > 0.4);
        }
      }
      if (!steady) continue;
      if (std::isnan(depth)) {
        wrong += canvas.visible(x, y, -1e9F) ? 0 : 1;
        continue;
      }
      ++seen;
      const auto at = [&](double d) { return canvas.visible(x, y, static_cast<float>(depth + d)); };
      wrong += !at(-tolerance) && at(tolerance) ? 0 : 1;
    }
  }
  EXPECT_GT(seen, 1000);
  EXPECT_EQ(wrong, 0);
}

double ball_front(double right, double up) {
  return std::sqrt(1 - right * right - up * up);  // NaN outside
}

Mat4R scaled(double x, double y, double z, const Vec3d& offset) {
  Mat4R m = Mat4R::identity();
  m.setToScale(Vec3d(x, y, z));
  m.postTranslate(Vec3d(0));
  m.setTranslation(offset);
  return m;
}

TEST(DrawLevelSet, DepthsAreASpheres) {
  const Vec3d utm(5e5, 4e6, 300);
  Mat4R turned = Mat4R::identity();
  turned.setToRotation(Vec3d(1, 2, 3).unit(), 0.7);
  turned = scaled(0.05, 0.05, 0.05, Vec3d(0)) * turned;
  for (const auto& [transform, centre] :
       {std::pair{scaled(0.05, 0.05, 0.05, Vec3d(0)), Vec3d(0)}, std::pair{scaled(0.05, 0.05, 0.05, utm), utm},
        std::pair{turned, Vec3d(0.3, 0, -2)}, std::pair{scaled(0.05, 0.025, 0.04, Vec3d(0)), Vec3d(0)},
        std::pair{scaled(-0.05, 0.05, 0.05, Vec3d(0)), Vec3d(0)}}) {
    expect_depths(sphere(transform, centre), looking(35, centre), ball_front, 0.01, 0.05);
  }
}

TEST(DrawLevelSet, TheRimOfAnOpenBandIsNoSurface) {
  // The half of the sphere with z > 0; the voxels of the other half are not known.
  const LevelSet half = sphere(scaled(0.05, 0.05, 0.05, Vec3d(0)), Vec3d(0), [](const Vec3d& p) { return p[2] > 0; });
  expect_depths(half, looking(0, Vec3d(0)), ball_front, 0.01, 0.12);
  // From behind one looks into the bowl.
  expect_depths(
      half, looking(180, Vec3d(0)), [](double x, double y) { return -ball_front(x, y); }, 0.01, 0.12);
  // From the side half of the disc is there: from azimuth 90 the z axis points left.
  expect_depths(
      half, looking(90, Vec3d(0)), [](double x, double y) { return x < 0 ? ball_front(x, y) : std::nan(""); }, 0.01,
      0.12);
}

TEST(DrawLevelSet, IsFramedAndColouredByItself) {
  LevelSet level_set = sphere(scaled(0.05, 0.05, 0.05, Vec3d(0)), Vec3d(7, 0, 0));
  auto data = std::make_shared<LevelSet::Data>(level_set.data());
  const auto colours = openvdb::Vec3SGrid::create();
  colours->setTransform(data->grid->transformPtr()->copy());
  for (auto voxel = data->grid->cbeginValueOn(); voxel; ++voxel)
    colours->tree().setValueOn(voxel.getCoord(), openvdb::Vec3s(0.1F, 0.9F, 0.1F));
  data->colours = colours;
  level_set = LevelSet(data);
  RenderSettings s;
  s.width = s.height = 100;
  Renderer renderer(s, {});
  renderer.frame(level_set);
  renderer.draw(level_set);
  const Image image = renderer.finish();
  const auto background = image.at(0, 0), middle = image.at(50, 50);
  EXPECT_GT(middle[1], middle[0] + 80);
  EXPECT_GT(middle[1], middle[2] + 80);
  // The disc nearly fills the picture, and is whole.
  for (int i = 0; i < 100; ++i)
    for (const auto& pixel : {image.at(0, i), image.at(99, i), image.at(i, 0), image.at(i, 99)})
      EXPECT_EQ(pixel, background);
  EXPECT_NE(image.at(8, 50), background);
  EXPECT_NE(image.at(50, 91), background);
}

TEST(DrawLevelSet, IsTheSameForAnyNumberOfThreads) {
  const LevelSet level_set = sphere(scaled(0.05, 0.05, 0.05, Vec3d(0)), Vec3d(0));
  const auto picture = [&](int threads) {
    RenderSettings s;
    s.width = s.height = 64;
    RunContext context;
    context.threads = threads;
    Renderer renderer(s, context);
    renderer.frame(level_set);
    renderer.draw(level_set);
    return renderer.finish().pixels;
  };
  EXPECT_EQ(picture(1), picture(2));
}

}  // namespace
}  // namespace lamina

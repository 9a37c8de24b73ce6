// Fogs drawn by rays, against what a block of even density must let through.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "lamina/error.h"
#include "lamina/render.h"
#include "lamina/volume.h"
#include "render/canvas.h"
#include "support/program.h"
#include "vdb/grids.h"
#include "vdb/vdb_file.h"
#include "volume/volume_data.h"

namespace lamina {
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using ::testing::HasSubstr;

constexpr int kSide = 40;

/// A cube of kSide voxels in each direction.
FloatGrid::Ptr block(float density, const openvdb::Vec3d& voxel = openvdb::Vec3d(0.05)) {
  openvdb::initialize();
  const FloatGrid::Ptr grid = FloatGrid::create(0);
  grid->setName("density");
  grid->setGridClass(openvdb::GRID_FOG_VOLUME);
  openvdb::Mat4R scale;
  scale.setToScale(voxel);
  grid->setTransform(openvdb::math::Transform::createLinearTransform(scale));
  grid->fill({Coord(0), Coord(kSide - 1)}, density);
  return grid;
}

Image picture(const FloatGrid::Ptr& grid, int threads = 0) {
  auto data = std::make_shared<FogVolume::Data>();
  data->grid = grid;
  const FogVolume fog(data);
  RenderSettings s;
  s.width = s.height = 60;
  s.supersample = 1;
  s.azimuth = s.elevation = 0;
  RunContext context;
  context.threads = threads;
  Renderer renderer(s, context);
  renderer.frame(fog);
  renderer.draw(fog);
  return renderer.finish();
}

TEST(DrawFog, LetsThroughWhatItsDensityLeaves) {
  using namespace render_detail;
  const Rgb lit_front = lit(kClay, {0, 0, 1}, false);
  for (const float density : {0.01F, 0.05F}) {
    for (const double depth : {0.05, 0.025}) {
      const Image image = picture(block(density, {0.05, 0.05, depth}));
      const auto background = image.at(0, 0), middle = image.at(30, 30);
      // The whole diagonal takes 36 times the density.
      const double diagonal = (kSide - 1) * std::hypot(0.05, 0.05, depth);
      const double opacity = 1 - std::exp(-36 * static_cast<double>(density) * kSide * depth / diagonal);
      for (std::size_t c = 0; c < 3; ++c) {
        const double expected =
            opacity * static_cast<double>(lit_front[c]) + (1 - opacity) * static_cast<double>(decode(background[c]));
        EXPECT_NEAR(middle[c], encode(static_cast<float>(expected)), 2) << density;
      }
    }
  }
}

TEST(DrawFog, FillsThePictureAndNoMore) {
  const Image image = picture(block(1));
  const auto background = image.at(0, 0);
  for (int i = 0; i < 60; ++i)
    for (const auto& pixel : {image.at(0, i), image.at(59, i), image.at(i, 0), image.at(i, 59)})
      EXPECT_EQ(pixel, background);
  EXPECT_NE(image.at(6, 30), background);
  EXPECT_NE(image.at(53, 30), background);
  EXPECT_NE(image.at(30, 6), background);
}

TEST(DrawFog, IsTheSameForAnyNumberOfThreads) {
  EXPECT_EQ(picture(block(0.1F), 1).pixels, picture(block(0.1F), 3).pixels);
}

TEST(ReadFog, TakesTheDensityAndRefusesTheRest) {
  const test::TemporaryFolder folder;
  const FloatGrid::Ptr other = block(1), level_set = block(1);
  other->setName("heat");
  level_set->setName("surface");
  level_set->setGridClass(openvdb::GRID_LEVEL_SET);
  volume::write_vdb({other, block(1), level_set}, folder / "all.vdb");
  EXPECT_EQ(read_fog(folder / "all.vdb").name(), "density");
  EXPECT_EQ(read_fog(folder / "all.vdb", "heat").name(), "heat");
  EXPECT_DOUBLE_EQ(read_fog(folder / "all.vdb").voxel(), 0.05);
  volume::write_vdb({level_set}, folder / "none.vdb");
  for (const auto& [file, name, said] :
       {std::tuple{"all.vdb", "surface", "is no fog volume"}, std::tuple{"all.vdb", "smoke", "no grid called smoke"},
        std::tuple{"none.vdb", "", "holds no fog volume; it holds surface"}}) {
    try {
      read_fog(folder / file, name);
      ADD_FAILURE() << said;
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ExitCode::unreadable);
      EXPECT_THAT(e.what(), HasSubstr(said));
    }
  }
}

}  // namespace
}  // namespace lamina

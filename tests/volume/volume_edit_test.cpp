// Volumes clipped and transformed, against what must be true of every voxel and point.
#include "lamina/volume_tools.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openvdb/tools/LevelSetSphere.h>

#include <filesystem>
#include <random>

#include "lamina/edit.h"
#include "lamina/error.h"
#include "lamina/volume_points.h"
#include "support/program.h"
#include "vdb/grids.h"
#include "vdb/vdb_file.h"

namespace lamina {
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::Vec3d;
using ::testing::HasSubstr;

constexpr float kVoxel = 0.08F;

class VolumeEdit : public ::testing::Test {
 protected:
  VolumeEdit() { openvdb::initialize(); }
  std::string write(const openvdb::GridCPtrVec& grids) {
    volume::write_vdb(grids, in_);
    return in_;
  }
  /// The unit sphere.
  static FloatGrid::Ptr sphere() {
    auto grid = openvdb::tools::createLevelSetSphere<FloatGrid>(1, openvdb::Vec3f(0), kVoxel);
    grid->setName("surface");
    return grid;
  }
  /// Density 1 in a block of tiles and of single voxels.
  static FloatGrid::Ptr fog() {
    auto grid = FloatGrid::create(0);
    grid->setName("density");
    grid->setGridClass(openvdb::GRID_FOG_VOLUME);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(kVoxel));
    grid->fill({Coord(-20, -128, 0), Coord(40, 130, 130)}, 1);
    return grid;
  }
  openvdb::GridBase::Ptr read(std::size_t i = 0) const { return volume::read_vdb(out_).grids.at(i); }
  template <class Edit>
  static std::string refusal(const Edit& edit, ExitCode code) {
    try {
      edit();
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), code) << e.what();
      return e.what();
    }
    return "nothing was thrown";
  }
  test::TemporaryFolder folder_;
  std::string in_ = folder_ / "in.vdb", out_ = folder_ / "out.vdb";
};

ClipRegion slanted() {
  ClipRegion region;
  region.box = Box{{-0.7, -3, 0.3}, {2.1, 0.55, 7}};
  region.half_spaces.push_back({{0.1, 0, 0}, {1, 0.5, 0.25}});
  return region;
}

TEST_F(VolumeEdit, ClipKeepsTheVoxelsThatBruteForceKeeps) {
  const std::string input = write({fog()});
  std::uint64_t voxels = 0;
  for (const Keep keep : {Keep::inside, Keep::outside}) {
    const VolumeEditStats stats = clip_volume(input, slanted(), keep, out_);
    const auto grid = openvdb::gridPtrCast<FloatGrid>(read());
    const auto after = grid->getConstAccessor();
    const FloatGrid::Ptr whole = fog();
    std::mt19937 random(5);
    const auto in = [&](int low, int high) { return std::uniform_int_distribution<int>(low, high)(random); };
    for (int i = 0; i < 30000; ++i) {
      const Coord at(in(-22, 42), in(-130, 132), in(-2, 132));
      const Vec3d p = whole->indexToWorld(at);
      const bool inside = contains(slanted(), {p[0], p[1], p[2]});
      const bool expected = whole->tree().isValueOn(at) && inside == (keep == Keep::inside);
      ASSERT_EQ(after.isValueOn(at), expected) << at;
      ASSERT_EQ(after.getValue(at), expected ? 1.0F : 0.0F) << at;
    }
    EXPECT_EQ(stats.voxels, grid->activeVoxelCount());
    voxels += stats.voxels;
    EXPECT_FALSE(volume::is_open(*grid)) << "a fog has no sides";
  }
  EXPECT_EQ(voxels, fog()->activeVoxelCount());
}

TEST_F(VolumeEdit, ClippedLevelSetIsOpenAndKeepsItsDistances) {
  ClipRegion upper;
  upper.half_spaces.push_back({{0, 0, 0}, {0, 1, 0}});
  clip_volume(write({sphere()}), upper, Keep::inside, out_);
  const auto grid = openvdb::gridPtrCast<FloatGrid>(read());
  EXPECT_TRUE(volume::is_open(*grid));
  EXPECT_EQ(grid->getGridClass(), openvdb::GRID_LEVEL_SET);
  const FloatGrid::Ptr whole = sphere();
  std::uint64_t expected = 0;
  for (auto value = whole->cbeginValueOn(); value; ++value)
    expected += whole->indexToWorld(value.getCoord())[1] >= 0 ? 1 : 0;
  EXPECT_EQ(grid->activeVoxelCount(), expected);
  for (auto value = grid->cbeginValueOn(); value; ++value) {
    ASSERT_GE(grid->indexToWorld(value.getCoord())[1], 0);
    ASSERT_EQ(*value, whole->tree().getValue(value.getCoord()));
  }
  // What holds everything changes nothing.
  ClipRegion all;
  all.box = Box{{-2, -2, -2}, {2, 2, 2}};
  clip_volume(in_, all, Keep::inside, out_);
  EXPECT_FALSE(volume::is_open(*read()));
  EXPECT_EQ(read()->activeVoxelCount(), whole->activeVoxelCount());
}

TEST_F(VolumeEdit, TransformMovesDistancesAndNormals) {
  const FloatGrid::Ptr distances = sphere();
  const auto normals = openvdb::Vec3SGrid::create();
  normals->setName("N");
  normals->setTransform(distances->transform().copy());
  normals->setVectorType(openvdb::VEC_COVARIANT_NORMALIZE);
  for (auto value = distances->cbeginValueOn(); value; ++value) {
    Vec3d p = distances->indexToWorld(value.getCoord());
    p.normalize();
    normals->tree().setValueOn(value.getCoord(), openvdb::Vec3s(p));
  }
  TransformSettings settings;
  settings.scale = {2.5, 2.5, 2.5};
  settings.rotate = {20, 30, 40};
  settings.translate = {500000, 4000000, 100};
  transform_volume(write({normals, distances}), make_transform(settings), out_);
  const auto n = openvdb::gridPtrCast<openvdb::Vec3SGrid>(read(0));
  const auto d = openvdb::gridPtrCast<FloatGrid>(read(1));
  EXPECT_NEAR(d->background(), 2.5 * distances->background(), 1e-6);
  EXPECT_EQ(d->activeVoxelCount(), distances->activeVoxelCount());
  for (auto value = d->cbeginValueOn(); value; ++value) {
    Vec3d p = d->indexToWorld(value.getCoord()) - Vec3d(500000, 4000000, 100);
    ASSERT_NEAR(*value, p.length() - 2.5, 1e-4);
    p.normalize();
    ASSERT_NEAR((Vec3d(n->tree().getValue(value.getCoord())) - p).length(), 0, 1e-5);
  }
}

TEST_F(VolumeEdit, PointsMoveAndAreClippedExactly) {
  PointArrays points;
  for (int i = 0; i < 64; ++i) {
    points.samples.x.push_back(i & 3), points.samples.y.push_back(i >> 2 & 3), points.samples.z.push_back(i >> 4);
    points.samples.radius.push_back(0.5F);
  }
  write_point_volume(points, {}, in_);
  TransformSettings settings;
  settings.scale = {4, 4, 4};
  const VolumeEditStats stats = transform_volume(in_, make_transform(settings), out_);
  EXPECT_EQ(stats.points, 64U);
  const SampleBatch moved = read_point_volume(out_).points.samples;
  ASSERT_EQ(moved.size(), 64U);
  double sum = 0;
  for (std::size_t i = 0; i < 64; ++i) {
    sum += moved.x[i] + moved.y[i] + moved.z[i];
    EXPECT_EQ(moved.radius[i], 2);
  }
  EXPECT_EQ(sum, 4 * 3 * 96);
  ClipRegion region;
  region.box = Box{{0, 0, 0}, {1, 1, 1}};
  EXPECT_EQ(clip_volume(in_, region, Keep::inside, out_).points, 8U);
  EXPECT_EQ(clip_volume(in_, region, Keep::outside, out_).points, 56U);
}

TEST_F(VolumeEdit, RefusesWhatWouldNotBeTrue) {
  write({sphere()});
  TransformSettings stretched;
  stretched.scale = {1, 2, 1};
  EXPECT_THAT(refusal([&] { transform_volume(in_, make_transform(stretched), out_); }, ExitCode::usage),
              HasSubstr("would be no distances"));
  ClipRegion far;
  far.box = Box{{7, 7, 7}, {8, 8, 8}};
  EXPECT_THAT(refusal([&] { clip_volume(in_, far, Keep::inside, out_); }, ExitCode::empty), HasSubstr("nothing"));
  EXPECT_THAT(refusal([&] { clip_volume(in_, {}, Keep::inside, out_); }, ExitCode::usage), HasSubstr("box or a plane"));

  const auto seen = FloatGrid::create(0);
  seen->setName("density");
  seen->setTransform(openvdb::math::Transform::createFrustumTransform(openvdb::BBoxd(Vec3d(0), Vec3d(9)), /*taper=*/0.5,
                                                                      /*depth=*/10, 1));
  seen->tree().setValueOn({1, 1, 1}, 1);
  write({seen});
  EXPECT_THAT(refusal([&] { transform_volume(in_, make_transform({}), out_); }, ExitCode::unreadable),
              HasSubstr("frustum"));
  EXPECT_FALSE(std::filesystem::exists(out_));
}

TEST_F(VolumeEdit, IsTheSameBytesForAnyNumberOfThreads) {
  write({sphere(), fog()});
  std::vector<std::string> bytes;
  for (const int threads : {1, 4}) {
    RunContext run;
    run.threads = threads;
    clip_volume(in_, slanted(), Keep::inside, out_, run);
    bytes.push_back(test::read_text(out_));
  }
  EXPECT_TRUE(bytes[0] == bytes[1]);
}

}  // namespace
}  // namespace lamina

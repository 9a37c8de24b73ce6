#include "lamina/volume_tools.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openvdb/tools/LevelSetSphere.h>

#include "lamina/error.h"
#include "lamina/volume.h"
#include "lamina/volume_points.h"
#include "reconstruct/clouds.h"
#include "support/program.h"
#include "vdb/grids.h"
#include "vdb/vdb_file.h"

namespace lamina {
namespace {

using openvdb::FloatGrid;
using ::testing::HasSubstr;

class MergeVolumes : public ::testing::Test {
 protected:
  MergeVolumes() { openvdb::initialize(); }
  std::string write(const std::string& name, const openvdb::GridCPtrVec& grids) {
    volume::write_vdb(grids, folder_ / name);
    return folder_ / name;
  }
  static FloatGrid::Ptr sphere(double x, float voxel = 0.1F, const std::string& name = "surface") {
    auto grid = openvdb::tools::createLevelSetSphere<FloatGrid>(1, openvdb::Vec3f(static_cast<float>(x), 0, 0), voxel);
    grid->setName(name);
    return grid;
  }
  std::string refusal(const std::vector<std::string>& inputs) {
    try {
      merge_volumes(inputs, out_);
    } catch (const Error& e) {
      return e.what();
    }
    return "";
  }
  test::TemporaryFolder folder_;
  std::string out_ = folder_ / "out.vdb";
};

TEST_F(MergeVolumes, JoinsWhatSurfaceSplit) {
  SurfaceSettings settings;
  settings.volume.path = folder_ / "whole.vdb";
  settings.volume.half = false;
  const test::Cloud cloud = test::sphere_cloud(8000);
  test::reconstruct(cloud, settings);
  settings.volume.path = folder_ / "part.vdb";
  settings.volume.split = 80000;
  const auto parts = test::reconstruct(cloud, settings).stats.volume.files;
  ASSERT_GE(parts.size(), 3U);
  EXPECT_EQ(parts[1], folder_ / "part.0002.vdb");
  merge_volumes(parts, out_);
  const auto whole = openvdb::gridPtrCast<FloatGrid>(volume::read_vdb(folder_ / "whole.vdb").grids.at(0));
  const auto joined = openvdb::gridPtrCast<FloatGrid>(volume::read_vdb(out_).grids.at(0));
  EXPECT_EQ(joined->activeVoxelCount(), whole->activeVoxelCount());
  const int reach = static_cast<int>(1.4 / whole->voxelSize()[0]);
  for (openvdb::CoordBBox::Iterator<true> at({openvdb::Coord(-reach), openvdb::Coord(reach)}); at; ++at) {
    ASSERT_EQ(joined->tree().isValueOn(*at), whole->tree().isValueOn(*at)) << *at;
    ASSERT_EQ(joined->tree().getValue(*at), whole->tree().getValue(*at)) << *at;
  }
}

TEST_F(MergeVolumes, UnitesSolidsAndKeepsOtherGrids) {
  const std::string a = write("a.vdb", {sphere(0), sphere(0, 0.2F, "coarse")}), b = write("b.vdb", {sphere(1.2)});
  const VolumeMergeStats stats = merge_volumes({a, b}, out_);
  EXPECT_EQ(stats.grids, 2U);
  const auto grid = openvdb::gridPtrCast<FloatGrid>(volume::read_vdb(out_).grids.at(1));
  ASSERT_EQ(grid->getName(), "surface");
  for (auto value = grid->cbeginValueOn(); value; ++value) {
    const auto p = grid->indexToWorld(value.getCoord());
    const double truth = std::min(p.length(), (p - openvdb::Vec3d(1.2, 0, 0)).length()) - 1;
    ASSERT_NEAR(*value, truth, 1e-3);
  }
  EXPECT_TRUE(test::check_mesh(mesh_level_set(read_level_set(out_)).triangles).is_closed_manifold());
}

TEST_F(MergeVolumes, PutsPointsWithDifferentAttributesTogether) {
  PointArrays a, b;
  for (PointArrays* p : {&a, &b}) p->samples.x = p->samples.y = p->samples.z = {0.5, 1, 2};
  a.layout = {{"heat", ScalarType::float32}};
  a.samples.attributes = {{1, 2, 3}};
  b.samples.radius = {4, 5, 6};
  write_point_volume(a, {}, folder_ / "a.vdb");
  write_point_volume(b, {}, folder_ / "b.vdb");
  std::string messages;
  RunContext run;
  run.log = [&](LogLevel, std::string_view text) { messages += text; };
  EXPECT_EQ(merge_volumes({folder_ / "a.vdb", folder_ / "b.vdb"}, out_, run).points, 6U);
  EXPECT_THAT(messages, HasSubstr("b.vdb: its points have other attributes"));
  const PointArrays all = read_point_volume(out_).points;
  EXPECT_THAT(all.samples.attributes.at(0), ::testing::UnorderedElementsAre(1, 2, 3, 0, 0, 0));
  EXPECT_THAT(all.samples.radius, ::testing::UnorderedElementsAre(0, 0, 0, 4, 5, 6));
  b.layout = {{"heat", ScalarType::int16}};
  b.samples.attributes = {{1, 2, 3}};
  write_point_volume(b, {}, folder_ / "b.vdb");
  EXPECT_THAT(refusal({folder_ / "a.vdb", folder_ / "b.vdb"}), HasSubstr("heat has another type"));
}

TEST_F(MergeVolumes, RefusesGridsThatDoNotFit) {
  const std::string a = write("a.vdb", {sphere(0)});
  EXPECT_THAT(refusal({}), HasSubstr("name the .vdb files"));
  EXPECT_THAT(refusal({a, write("b.vdb", {sphere(0, 0.2F)})}), HasSubstr("differ in transform"));
  auto vectors = openvdb::Vec3SGrid::create();
  vectors->setName("surface");
  EXPECT_THAT(refusal({a, write("b.vdb", {vectors})}), HasSubstr("differ in type"));
  auto fog = sphere(0);
  fog->setGridClass(openvdb::GRID_FOG_VOLUME);
  EXPECT_THAT(refusal({a, write("b.vdb", {fog})}), HasSubstr("differ in class"));
  EXPECT_THAT(refusal({a, folder_ / "none.vdb"}), HasSubstr("none.vdb"));
  EXPECT_FALSE(std::filesystem::exists(out_));
}

}  // namespace
}  // namespace lamina

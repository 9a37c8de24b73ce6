// Level sets read from files, and the way back to meshes and fogs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openvdb/tools/LevelSetSphere.h>

#include <cmath>
#include <filesystem>
#include <numbers>

#include "lamina/error.h"
#include "lamina/volume.h"
#include "lamina/volume_tools.h"
#include "reconstruct/clouds.h"
#include "render/shapes.h"
#include "support/mesh_check.h"
#include "support/program.h"
#include "vdb/grids.h"
#include "vdb/vdb_file.h"

namespace lamina {
namespace {

using openvdb::FloatGrid;
using openvdb::math::Transform;
using ::testing::HasSubstr;

/// The level set of a sphere, sampled from its formula.
FloatGrid::Ptr sphere_grid(double radius, const Transform::Ptr& transform, const openvdb::Vec3d& centre) {
  const double voxel = transform->voxelSize()[0];
  auto grid = FloatGrid::create(static_cast<float>(3 * voxel));
  grid->setTransform(transform);
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  grid->setName("surface");
  const openvdb::Coord middle = openvdb::Coord::round(transform->worldToIndex(centre));
  const int reach = static_cast<int>(radius / voxel) + 5;
  openvdb::CoordBBox box(middle.offsetBy(-reach), middle.offsetBy(reach));
  for (openvdb::CoordBBox::Iterator<true> at(box); at; ++at) {
    const double d = (transform->indexToWorld(*at) - centre).length() - radius;
    if (std::abs(d) < 3 * voxel)
      grid->tree().setValueOn(*at, static_cast<float>(d));
    else if (d < 0)
      grid->tree().setValueOff(*at, static_cast<float>(-3 * voxel));
  }
  return grid;
}

double signed_volume(const TriangleMesh& mesh) {
  double sum = 0;
  const auto& o = mesh.positions[0];
  for (const auto& t : mesh.triangles) {
    openvdb::Vec3d p[3];
    for (int k = 0; k < 3; ++k) p[k] = openvdb::Vec3d(mesh.positions[t[k]].data()) - openvdb::Vec3d(o.data());
    sum += p[0].dot(p[1].cross(p[2])) / 6;
  }
  return sum;
}

class LevelSets : public ::testing::Test {
 protected:
  LevelSets() { openvdb::initialize(); }
  LevelSet through_file(const openvdb::GridCPtrVec& grids, const std::string& name = {}) {
    volume::write_vdb(grids, path_);
    return read_level_set(path_, name);
  }
  std::string refusal(const std::string& name = {}) {
    try {
      read_level_set(path_, name);
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ExitCode::unreadable);
      EXPECT_THAT(e.what(), HasSubstr(path_));
      return e.what();
    }
    return "";
  }
  test::TemporaryFolder folder_;
  std::string path_ = folder_ / "in.vdb";
};

TEST_F(LevelSets, FromAMeshAndBackStayWithinATenthOfAVoxel) {
  constexpr double kVoxel = 0.1;
  const TriangleMesh truth = test::sphere(1, 40);
  for (const bool half : {false, true}) {
    write_volume(truth, {.voxel = kVoxel, .half = half}, path_);
    const TriangleMesh mesh = mesh_level_set(read_level_set(path_));
    const auto facts = test::check_mesh(mesh.triangles);
    EXPECT_TRUE(facts.is_closed_manifold());
    for (const auto& p : mesh.positions) ASSERT_NEAR(test::length(p), 1, 0.1 * kVoxel);
    EXPECT_NEAR(test::area(mesh), 4 * std::numbers::pi, 0.01 * 4 * std::numbers::pi);
    EXPECT_GT(signed_volume(mesh), 4);
  }
}

TEST_F(LevelSets, OfAnyLinearTransformMeshInTheWorld) {
  const openvdb::Vec3d centre(431000.25, 5213000.5, 800);
  // Rotated, mirrored and georeferenced.
  for (const bool mirrored : {false, true}) {
    auto transform = Transform::createLinearTransform(0.1);
    transform->postRotate(0.7, openvdb::math::X_AXIS);
    transform->postRotate(0.3, openvdb::math::Z_AXIS);
    if (mirrored) transform->postScale({1, -1, 1});
    transform->postTranslate(centre);
    const TriangleMesh mesh = mesh_level_set(through_file({sphere_grid(1, transform, centre + openvdb::Vec3d(0.03))}));
    EXPECT_TRUE(test::check_mesh(mesh.triangles).is_closed_manifold());
    EXPECT_GT(signed_volume(mesh), 4) << mirrored;
    for (const auto& p : mesh.positions)
      ASSERT_NEAR((openvdb::Vec3d(p.data()) - centre - openvdb::Vec3d(0.03)).length(), 1, 0.01);
  }
}

TEST_F(LevelSets, SimplifyFlatPartsWhenAsked) {
  const auto sphere = through_file({sphere_grid(1, Transform::createLinearTransform(0.04), {0, 0, 0})});
  const TriangleMesh fine = mesh_level_set(sphere), coarse = mesh_level_set(sphere, {.adaptivity = 0.5});
  EXPECT_LT(coarse.triangles.size(), fine.triangles.size() / 2);
  for (const auto& p : mesh_level_set(sphere, {.isovalue = 0.05}).positions) ASSERT_NEAR(test::length(p), 1.05, 0.004);
  EXPECT_THROW(mesh_level_set(sphere, {.adaptivity = 2}), Error);
  EXPECT_THROW(mesh_level_set(sphere, {.isovalue = 0.5}), Error);
}

TEST_F(LevelSets, FromHoudiniBecomeAClosedMesh) {
  const std::string path = std::string(LAMINA_SOURCE_DIR) + "/../shared/data/levelset_sphere.vdb";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not there";
  const LevelSet sphere = read_level_set(path);
  EXPECT_EQ(sphere.name(), "ls_sphere");
  EXPECT_FALSE(sphere.open());
  const TriangleMesh mesh = mesh_level_set(sphere);
  EXPECT_TRUE(test::check_mesh(mesh.triangles).is_closed_manifold());
  // Its radius is 3, less the little that its own tessellation took.
  double radius = 0;
  for (const auto& p : mesh.positions) radius += test::length(p) / static_cast<double>(mesh.positions.size());
  EXPECT_NEAR(radius, 3, 0.01);
  EXPECT_NEAR(test::area(mesh), 4 * std::numbers::pi * 9, 0.005 * 4 * std::numbers::pi * 9);
  const VolumeInfo info = describe_volume(path);
  ASSERT_EQ(info.grids.size(), 1U);
  const GridInfo& grid = info.grids[0];
  EXPECT_EQ(grid.active_voxels, 270638U);  // what vdb_print says
  EXPECT_EQ(grid.leaf_nodes, 1451U);
  EXPECT_EQ(grid.internal_nodes, 16U);
  EXPECT_EQ(grid.grid_class, "level set");
  EXPECT_TRUE(grid.half);
  EXPECT_EQ(grid.index_low, (std::array<std::int32_t, 3>{-62, -62, -62}));
  EXPECT_NEAR(grid.world_high[2], 3.1, 1e-6);
  EXPECT_NEAR(grid.value_low, -0.149536, 1e-6);
}

TEST_F(LevelSets, BecomeFog) {
  constexpr double kVoxel = 0.05;
  const auto sphere = through_file({sphere_grid(1, Transform::createLinearTransform(kVoxel), {0, 0, 0})});
  const std::string fog_path = folder_ / "fog.vdb";
  for (const double ramp : {0.0, kVoxel}) {
    write_fog(sphere, {.ramp = ramp}, fog_path);
    const auto file = volume::read_vdb(fog_path);
    ASSERT_EQ(file.grids.size(), 1U);
    const auto fog = openvdb::gridPtrCast<FloatGrid>(file.grids[0]);
    EXPECT_EQ(fog->getName(), "density");
    EXPECT_EQ(fog->getGridClass(), openvdb::GRID_FOG_VOLUME);
    const double width = ramp > 0 ? ramp : 3 * kVoxel;
    for (openvdb::CoordBBox::Iterator<true> at(openvdb::CoordBBox(openvdb::Coord(-24), openvdb::Coord(24))); at; ++at) {
      const double d = fog->indexToWorld(*at).length() - 1;
      ASSERT_NEAR(fog->tree().getValue(*at), std::clamp(-d / width, 0.0, 1.0), 1e-5) << *at;
    }
  }
  EXPECT_THAT([&] { read_level_set(fog_path); }, ::testing::ThrowsMessage<Error>(HasSubstr("density (a fog volume)")));
  EXPECT_THROW(write_fog(sphere, {.name = ""}, fog_path), Error);
}

TEST_F(LevelSets, AreFoundAmongOtherGrids) {
  const auto transform = Transform::createLinearTransform(0.2);
  auto surface = sphere_grid(1, transform, {0, 0, 0}), other = sphere_grid(0.5, transform, {0, 0, 0});
  other->setName("a_smaller_one");
  auto colours = openvdb::Vec3SGrid::create();
  colours->setName("Cd");
  EXPECT_EQ(through_file({other, colours, surface}).name(), "surface");
  EXPECT_EQ(read_level_set(path_, "a_smaller_one").name(), "a_smaller_one");
  EXPECT_THAT(refusal("Cd"), HasSubstr("grid Cd is no level set"));
  EXPECT_THAT(refusal("none"),
              HasSubstr("no grid called none; it holds Cd (vec3s values), a_smaller_one (a level set)"));
  // Made by the library, as a file's are (grids.h).
  const auto doubles =
      openvdb::gridPtrCast<openvdb::DoubleGrid>(openvdb::GridBase::createGrid(openvdb::DoubleGrid::gridType()));
  doubles->tree().root().setBackground(0.6, false);
  doubles->setName("d");
  doubles->tree().setValueOn({1, 2, 3}, 0.25);
  EXPECT_EQ(through_file({doubles}).name(), "d");
}

TEST_F(LevelSets, OfOtherKindsAreRefusedByName) {
  const auto transform = Transform::createLinearTransform(0.2);
  auto grid = sphere_grid(1, transform, {0, 0, 0});
  grid->setTransform(Transform::createFrustumTransform(openvdb::BBoxd({0, 0, 0}, {10, 10, 10}), 0.5, 4, 0.1));
  volume::write_vdb({grid}, path_);
  EXPECT_THAT(refusal(), HasSubstr("frustum"));
  EXPECT_FALSE(describe_volume(path_).grids[0].linear);
  volume::write_vdb({FloatGrid::create(1.0F)}, path_);
  EXPECT_THAT(refusal(), HasSubstr("no active voxels"));
  volume::write_vdb({}, path_);
  EXPECT_THAT(refusal(), HasSubstr("holds no grids"));
  EXPECT_THROW(describe_volume(path_), Error);
  auto zero = FloatGrid::create(0.0F);
  zero->tree().setValueOn({0, 0, 0}, 1);
  volume::write_vdb({zero}, path_);
  EXPECT_THAT(refusal(), HasSubstr("outside its band"));
}

TEST_F(LevelSets, CutOffOrDestroyedAreRefused) {
  volume::write_vdb({sphere_grid(1, Transform::createLinearTransform(0.2), {0, 0, 0})}, path_);
  const std::string bytes = test::read_text(path_);
  for (std::size_t cut = 0; cut < bytes.size(); cut += 1 + bytes.size() / 97) {
    test::write_file(path_, bytes.substr(0, cut));
    EXPECT_NE(refusal(), "") << cut;
  }
  test::write_file(path_, "ply\nformat ascii 1.0\nend_header\n");
  EXPECT_THAT(refusal(), HasSubstr("not a .vdb file"));
  std::filesystem::remove(path_);
  EXPECT_THAT(refusal(), HasSubstr("cannot be opened"));
  std::filesystem::create_directory(path_);
  EXPECT_THAT(refusal(), HasSubstr("is a directory"));
}

}  // namespace
}  // namespace lamina

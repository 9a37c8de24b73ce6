// The grids that a reconstruction writes, against the surfaces they are reconstructed from.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openvdb/tools/Interpolation.h>

#include <cmath>
#include <filesystem>
#include <numbers>

#include "lamina/error.h"
#include "lamina/volume.h"
#include "lamina/volume_points.h"
#include "lamina/volume_tools.h"
#include "reconstruct/clouds.h"
#include "support/program.h"
#include "vdb/grids.h"
#include "vdb/vdb_file.h"

namespace lamina {
namespace {

using openvdb::FloatGrid;
using openvdb::Vec3d;
using test::Cloud;
using test::Point3;
using ::testing::HasSubstr;

class SurfaceVolumes : public ::testing::Test {
 protected:
  SurfaceVolumes() { settings_.volume.path = path_; }
  test::Reconstruction run(const Cloud& cloud, int threads = 0) {
    RunContext context;
    context.threads = threads;
    return test::reconstruct(cloud, settings_, context);
  }
  template <class Grid>
  static typename Grid::Ptr grid(const std::string& path, const std::string& name) {
    for (const auto& g : volume::read_vdb(path).grids)
      if (g->getName() == name) return openvdb::gridPtrCast<Grid>(g);
    throw std::runtime_error("no grid " + name);
  }
  FloatGrid::Ptr surface() const { return grid<FloatGrid>(path_, "surface"); }

  test::TemporaryFolder folder_;
  std::string path_ = folder_ / "out.vdb";
  SurfaceSettings settings_;
};

Cloud moved(Cloud cloud, const Point3& by) {
  for (Point3& p : cloud.positions)
    for (std::size_t k = 0; k < 3; ++k) p[k] += by[k];
  return cloud;
}

TEST_F(SurfaceVolumes, HoldTheDistanceOfASphereInTheWholeBand) {
  for (const double band : {1.0, 3.0, 5.0}) {
    settings_.volume.band = band;
    const auto result = run(test::sphere_cloud(6000));
    const auto level_set = surface();
    const double voxel = result.stats.volume.voxel;
    EXPECT_EQ(level_set->getGridClass(), openvdb::GRID_LEVEL_SET);
    EXPECT_NEAR(level_set->background(), band * voxel, 1e-3 * band * voxel);
    EXPECT_NEAR(level_set->voxelSize()[0], voxel, 1e-9);
    EXPECT_FALSE(volume::is_open(*level_set));
    const int reach = static_cast<int>(1 / voxel) + 8;
    const openvdb::Coord middle = openvdb::Coord::round(level_set->worldToIndex(Vec3d(0.0)));
    std::uint64_t active = 0;
    for (openvdb::CoordBBox::Iterator<true> at({middle.offsetBy(-reach), middle.offsetBy(reach)}); at; ++at) {
      const double truth = level_set->indexToWorld(*at).length() - 1;
      float value = 0;
      const bool on = level_set->tree().probeValue(*at, value);
      active += on;
      if (std::abs(truth) < (band - 0.3) * voxel) {
        ASSERT_TRUE(on) << *at << " " << truth / voxel;
        // Cells of a sphere of twenty-odd voxels' radius.
        ASSERT_NEAR(value, truth, (band > 3 ? 0.3 : 0.1) * voxel) << *at;
      } else if (std::abs(truth) > (band + 0.3) * voxel) {
        ASSERT_FALSE(on) << *at;
        ASSERT_EQ(value, std::copysign(level_set->background(), truth)) << *at << " " << truth / voxel;
      }
    }
    EXPECT_EQ(active, result.stats.volume.voxels);
    // The surface of the grid is that of the mesh.
    const TriangleMesh mesh = mesh_level_set(read_level_set(path_));
    EXPECT_TRUE(test::check_mesh(mesh.triangles).is_closed_manifold());
    EXPECT_NEAR(test::area(mesh), test::area(result.mesh), 0.01 * test::area(mesh));
  }
}

TEST_F(SurfaceVolumes, LieAlongTheInputsAxes) {
  // Longest along each axis in turn: the sweep axis changes, the grid's axes do not.
  for (std::size_t axis = 0; axis < 3; ++axis) {
    Cloud cloud = test::sphere_cloud(4000);
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      cloud.positions[i][axis] *= 1.3;
      cloud.normals[i][axis] /= 1.3;
    }
    const auto result = run(moved(cloud, {3, -5, 8}));
    const GridInfo info = describe_volume(path_).grids.at(0);
    EXPECT_TRUE(info.uniform);
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(info.index_to_world[r][c], r == c ? info.voxel[0] : 0);
    const auto level_set = surface();
    const openvdb::tools::GridSampler<FloatGrid, openvdb::tools::BoxSampler> sample(*level_set);
    for (std::size_t i = 0; i < cloud.size(); i += 7) {
      const Point3& p = cloud.positions[i];
      ASSERT_NEAR(sample.wsSample(Vec3d(p[0] + 3, p[1] - 5, p[2] + 8)), 0, 0.1 * result.stats.volume.voxel);
    }
  }
}

TEST_F(SurfaceVolumes, TurnWithTheFrameAndKeepGeoreferencedCoordinates) {
  settings_.frame = FrameMode::pca;
  settings_.volume.half = false;
  settings_.volume.grids = {"N"};
  Cloud cloud = test::torus_cloud(16000);
  const Point3 offset{431000, 5213000, 800};
  test::TemporaryFolder folder;
  settings_.input =
      test::write_cloud(moved(cloud, offset), folder / "in.ply", PlyFormat::little_endian, ScalarType::float64);
  settings_.output = folder / "out.ply";
  const SurfaceStats stats = reconstruct_surface(settings_, {});
  const auto level_set = surface();
  const openvdb::tools::GridSampler<FloatGrid, openvdb::tools::BoxSampler> sample(*level_set);
  for (std::size_t i = 0; i < cloud.size(); i += 7) {
    const Point3& p = cloud.positions[i];
    ASSERT_NEAR(sample.wsSample(Vec3d(p[0] + offset[0], p[1] + offset[1], p[2] + offset[2])), 0,
                0.1 * stats.volume.voxel);
  }
  const auto normals = grid<openvdb::Vec3SGrid>(path_, "N");
  EXPECT_EQ(normals->activeVoxelCount(), level_set->activeVoxelCount());
  for (auto value = level_set->cbeginValueOn(); value; ++value) {
    const Vec3d p = level_set->indexToWorld(value.getCoord()) - Vec3d(offset.data());
    const double around = std::hypot(p[0], p[2]);
    Vec3d truth(p[0] * (1 - test::kTorusMajor / around), p[1], p[2] * (1 - test::kTorusMajor / around));
    ASSERT_NEAR(*value, truth.length() - test::kTorusMinor, 0.2 * stats.volume.voxel);
    truth.normalize();
    ASSERT_GT(truth.dot(Vec3d(normals->tree().getValue(value.getCoord()))), 0.95);
  }
}

TEST_F(SurfaceVolumes, CarryColoursAndAttributes) {
  Cloud cloud = test::sphere_cloud(5000);
  const char* names[] = {"red", "green", "blue"};
  for (std::size_t k = 0; k < 3; ++k)
    cloud.add_property(names[k], ScalarType::uint8, [k](const Point3& p) { return std::floor(127.5 + 100 * p[k]); });
  cloud.add_property("heat", ScalarType::float32, [](const Point3& p) { return 20 * p[2]; });
  settings_.volume.grids = {"Cd", "heat", "weight", "curvature"};
  const double voxel = run(cloud).stats.volume.voxel;
  const auto level_set = surface();
  const auto colours = grid<openvdb::Vec3SGrid>(path_, "Cd");
  const auto heat = grid<FloatGrid>(path_, "heat"), weight = grid<FloatGrid>(path_, "weight"),
             curvature = grid<FloatGrid>(path_, "curvature");
  double near = 0, weights = 0;
  for (auto value = level_set->cbeginValueOn(); value; ++value) {
    const openvdb::Coord at = value.getCoord();
    Vec3d p = level_set->indexToWorld(at);
    p.normalize();
    ASSERT_TRUE(colours->tree().isValueOn(at));
    for (int k = 0; k < 3; ++k) ASSERT_NEAR(colours->tree().getValue(at)[k], (127 + 100 * p[k]) / 255, 0.06);
    ASSERT_NEAR(heat->tree().getValue(at), 20 * p[2], 2.5);
    ASSERT_GE(weight->tree().getValue(at), 0);
    ASSERT_LE(weight->tree().getValue(at), 1);
    if (std::abs(*value) < 0.5 * voxel) {
      near += 1;
      weights += weight->tree().getValue(at);
      ASSERT_NEAR(curvature->tree().getValue(at), 1, 0.2);
    }
  }
  EXPECT_GT(weights, 0.5 * near);
  settings_.volume.grids = {VolumeExport::kColours};
  run(cloud);
  EXPECT_EQ(describe_volume(path_).grids.size(), 2U);
  settings_.volume.grids = {"glow"};
  EXPECT_THAT([&] { run(cloud); }, ::testing::ThrowsMessage<Error>(HasSubstr("heat")));
}

TEST_F(SurfaceVolumes, AreOpenWhereTheDataEnds) {
  // Half a sphere, and a plane: a band near data, and no inside far away.
  const Cloud half = test::sphere_cloud(20000, [](const Point3& v) { return v[2] > 0 ? 1.0 : 0.0; });
  const auto result = run(half);
  const auto level_set = surface();
  EXPECT_TRUE(volume::is_open(*level_set));
  for (auto value = level_set->cbeginValueOn(); value; ++value)
    ASSERT_GT(level_set->indexToWorld(value.getCoord())[2], -4 * result.stats.volume.voxel);
  EXPECT_EQ(level_set->tree().getValue(openvdb::Coord::round(level_set->worldToIndex({0, 0, 0.1}))),
            level_set->background());
  // Nothing but the surface itself comes out of a mesher: no wall where the band ends inside.
  const TriangleMesh mesh = mesh_level_set(read_level_set(path_));
  for (const auto& p : mesh.positions) ASSERT_NEAR(test::length(p), 1, 1.5 * result.stats.volume.voxel);
  EXPECT_NEAR(test::area(mesh), 2 * std::numbers::pi, 0.08 * 2 * std::numbers::pi);
}

TEST_F(SurfaceVolumes, TakeEveryLevelOfTheOctree) {
  // Sixteen times as dense at one end as at the other: three levels of cells.
  const Cloud cloud = test::sphere_cloud(10000, [](const Point3& v) { return std::exp2(2 * (v[2] - 1)); });
  const auto result = run(cloud);
  std::size_t used = 0;
  for (const auto n : result.stats.leaf_cells) used += n > 1000;
  EXPECT_GE(used, 2U);
  const TriangleMesh mesh = mesh_level_set(read_level_set(path_));
  EXPECT_TRUE(test::check_mesh(mesh.triangles).is_closed_manifold());
  for (const auto& p : mesh.positions) ASSERT_NEAR(test::length(p), 1, 0.3 * result.stats.volume.voxel);
  // Asked for other voxels, the nearest level's.
  settings_.volume.voxel = 2.2 * result.stats.volume.voxel;
  const auto coarse = run(cloud);
  EXPECT_NEAR(coarse.stats.volume.voxel, 2 * result.stats.volume.voxel, 1e-12);
  EXPECT_TRUE(test::check_mesh(mesh_level_set(read_level_set(path_)).triangles).is_closed_manifold());
  settings_.volume = {};
  settings_.volume.path = path_;
  settings_.volume.levels = true;
  run(cloud);
  const VolumeInfo info = describe_volume(path_);
  ASSERT_EQ(info.grids.size(), result.stats.leaf_cells.size());
  EXPECT_EQ(info.grids[0].name, "surface_L0");
  EXPECT_NEAR(info.grids[1].voxel[0], 2 * info.grids[0].voxel[0], 1e-12);
  for (const GridInfo& g : info.grids) {
    EXPECT_LT(g.value_high, 3.01 * g.voxel[0]);
    EXPECT_LT(g.world_high[0], 1.3);
  }
}

TEST_F(SurfaceVolumes, AreTheSameBytesForThreadsAndWindows) {
  Cloud cloud = test::sphere_cloud(6000, [](const Point3& v) { return std::exp2(v[2] - 1); });
  cloud.add_property("heat", ScalarType::float32, [](const Point3& p) { return p[2]; });
  settings_.volume.grids = {"N", "heat"};
  settings_.volume.points = folder_ / "points.vdb";
  const auto bytes = [&] { return test::read_text(path_) + test::read_text(settings_.volume.points); };
  run(cloud, 1);
  const std::string one = bytes();
  run(cloud, 4);
  EXPECT_TRUE(bytes() == one);
  settings_.window = 5;
  run(cloud, 2);
  EXPECT_TRUE(bytes() == one);
}

TEST_F(SurfaceVolumes, LeaveTheMeshAsItIs) {
  Cloud cloud = test::sphere_cloud(6000, [](const Point3& v) { return std::exp2(v[2] - 1); });
  cloud.add_property("heat", ScalarType::float32, [](const Point3& p) { return p[2]; });
  settings_.frame = FrameMode::axis;
  settings_.input = test::write_cloud(cloud, folder_ / "in.ply");
  settings_.output = folder_ / "with.ply";
  settings_.volume.points = folder_ / "points.vdb";
  reconstruct_surface(settings_, {});
  settings_.volume = {};
  settings_.output = folder_ / "without.ply";
  reconstruct_surface(settings_, {});
  EXPECT_TRUE(test::read_text(folder_ / "with.ply") == test::read_text(folder_ / "without.ply"));
}

TEST_F(SurfaceVolumes, WriteTheProjectedCorners) {
  Cloud cloud = test::sphere_cloud(5000);
  cloud.add_property("red", ScalarType::uint8, [](const Point3&) { return 200; });
  cloud.add_property("green", ScalarType::uint8, [](const Point3&) { return 100; });
  cloud.add_property("blue", ScalarType::uint8, [](const Point3&) { return 50; });
  settings_.volume.path = "";
  settings_.volume.points = folder_ / "points.vdb";
  const auto result = run(cloud);
  const PointVolume points = read_point_volume(settings_.volume.points);
  const SampleBatch& s = points.points.samples;
  EXPECT_EQ(s.size(), result.stats.volume.points);
  EXPECT_GT(s.size(), result.mesh.positions.size() / 2);
  for (std::size_t i = 0; i < s.size(); ++i) {
    const double r = std::hypot(s.x[i], s.y[i], s.z[i]);
    ASSERT_NEAR(r, 1, 0.01);
    ASSERT_GT((s.nx[i] * s.x[i] + s.ny[i] * s.y[i] + s.nz[i] * s.z[i]) / r, 0.99);
    ASSERT_GT(s.radius[i], 0);
  }
  EXPECT_EQ(points.points.layout.at(0), (AttributeSpec{"red", ScalarType::uint8}));
  EXPECT_EQ(s.attributes[0][0], 200);
  // More than a file holds become a sequence.
  settings_.volume.points_per_file = s.size() / 3 + 1;
  const auto split = run(cloud);
  ASSERT_EQ(split.stats.volume.files.size(), 3U);
  EXPECT_EQ(split.stats.volume.files[2], folder_ / "points.0003.vdb");
  std::uint64_t sum = 0;
  for (const std::string& file : split.stats.volume.files) sum += describe_volume(file).grids[0].point_count;
  EXPECT_EQ(sum, s.size());
}

TEST_F(SurfaceVolumes, LeaveNothingBehindWhenTheyFail) {
  const Cloud cloud = test::sphere_cloud(2000);
  const auto code = [&] {
    try {
      run(cloud);
    } catch (const Error& e) {
      return e.code();
    }
    return ExitCode::ok;
  };
  settings_.volume.band = 0.5;
  EXPECT_EQ(code(), ExitCode::usage);
  settings_.volume.band = 3;
  settings_.volume.path = folder_ / "no/such/out.vdb";
  EXPECT_EQ(code(), ExitCode::budget);
  settings_.volume.path = "-";
  EXPECT_EQ(code(), ExitCode::usage);
  settings_.volume.path = folder_ / "grid";
  EXPECT_EQ(code(), ExitCode::usage) << "no .vdb to other programs";
  settings_.volume.path = path_;
  for (const double voxel : {1e-4, 100.0}) {
    settings_.volume.voxel = voxel;
    EXPECT_EQ(code(), ExitCode::usage) << voxel << " is far from every cell";
  }
  settings_.volume.voxel = 0;
  settings_.cell = {1e-7, Length::Unit::world};
  EXPECT_EQ(code(), ExitCode::usage);
  EXPECT_EQ(folder_.entries(), 0);
}

}  // namespace
}  // namespace lamina

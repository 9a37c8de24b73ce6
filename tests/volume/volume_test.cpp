#include "lamina/volume.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openvdb/io/Stream.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>
#include <stdexcept>

#include "lamina/error.h"
#include "measure/triangle_bvh.h"
#include "render/shapes.h"
#include "support/program.h"
#include "vdb/grids.h"

namespace lamina {
namespace {

using ::testing::HasSubstr;

constexpr double kRadius = 1.3;
constexpr std::uint32_t kRings = 48;
/// How far the polyhedron lies inside its sphere at most.
const double kSag = kRadius * (1 - std::pow(std::cos(std::numbers::pi / (2 * kRings)), 2));

/// Every vertex coloured by its position, as a fraction of the type's range.
void colour_by_position(TriangleMesh& mesh, ScalarType type, float range) {
  mesh.layout = {{"red", type}, {"green", type}, {"blue", type}};
  mesh.attributes.assign(3, {});
  for (const auto& p : mesh.positions) {
    for (std::size_t k = 0; k < 3; ++k)
      mesh.attributes[k].push_back(range * static_cast<float>(0.5 + p[k] / (4 * kRadius)));
  }
}

class Volume : public ::testing::Test {
 protected:
  Volume() {
    run_.log = [this](LogLevel, std::string_view text) { messages_ += text; };
  }
  /// Writes and reads back.
  openvdb::GridPtrVec grids(const TriangleMesh& mesh, const VolumeSettings& settings) {
    stats_ = write_volume(mesh, settings, path_, run_);
    openvdb::initialize();
    std::istringstream stream(test::read_text(path_), std::ios::binary);
    EXPECT_EQ(stream.str().size(), stats_.bytes);
    openvdb::io::Stream file(stream);
    return *file.getGrids();
  }
  /// The file's order of grids is OpenVDB's affair.
  template <class Grid>
  static typename Grid::Ptr find(const openvdb::GridPtrVec& all, const std::string& name) {
    for (const auto& grid : all)
      if (grid->getName() == name) return openvdb::gridPtrCast<Grid>(grid);
    throw std::runtime_error("no grid " + name);
  }
  openvdb::FloatGrid::Ptr distances(const TriangleMesh& mesh, const VolumeSettings& settings) {
    return find<openvdb::FloatGrid>(grids(mesh, settings), settings.name);
  }

  test::TemporaryFolder folder_;
  std::string path_ = folder_ / "out.vdb", messages_;
  RunContext run_;
  VolumeStats stats_;
};

TEST_F(Volume, HoldsTheSignedDistanceOfASphere) {
  const std::array<double, 3> centre{0.31, -20.2, 5.07};
  for (const double band : {1.0, 3.0, 7.5}) {
    const auto grid = distances(test::sphere(kRadius, kRings, centre), {.voxel = 0.06, .band = band});
    EXPECT_EQ(grid->getGridClass(), openvdb::GRID_LEVEL_SET);
    EXPECT_TRUE(stats_.has_sign);
    EXPECT_EQ(stats_.voxels, grid->activeVoxelCount());
    EXPECT_FLOAT_EQ(grid->background(), static_cast<float>(0.06 * band));
    const auto low = openvdb::Coord::floor(grid->worldToIndex({centre[0] - 2, centre[1] - 2, centre[2] - 2}));
    std::uint64_t band_voxels = 0;
    for (openvdb::CoordBBox::Iterator<true> at(openvdb::CoordBBox(low, low.offsetBy(67))); at; ++at) {
      const auto p = grid->indexToWorld(*at);
      const double truth = (p - openvdb::Vec3d(centre.data())).length() - kRadius;
      float value = 0;
      const bool active = grid->tree().probeValue(*at, value);
      band_voxels += active;
      if (truth < 0.06 * band - kSag && truth > -0.06 * band + kSag) {
        ASSERT_TRUE(active) << *at;
        ASSERT_NEAR(value, truth, kSag) << *at;
      } else if (truth > 0.06 * band || truth < -0.06 * band - kSag) {
        ASSERT_FALSE(active) << *at;
        ASSERT_FLOAT_EQ(value, static_cast<float>(std::copysign(0.06 * band, truth))) << *at;
      }
    }
    EXPECT_EQ(band_voxels, stats_.voxels);
  }
}

TEST_F(Volume, HoldsTheExactDistanceToTheTriangles) {
  const TriangleMesh mesh = test::sphere(kRadius, 7);  // large flat faces
  const auto grid = distances(mesh, {.voxel = 0.11, .band = 5});
  std::uint64_t i = 0;
  for (auto value = grid->cbeginValueOn(); value; ++value) {
    if (++i % 7 != 0) continue;
    const auto p = grid->indexToWorld(value.getCoord());
    double best = 1e300;
    for (const auto& t : mesh.triangles) {
      best = std::min(best, measure::squared_distance_to_triangle({p.x(), p.y(), p.z()}, mesh.positions[t[0]],
                                                                  mesh.positions[t[1]], mesh.positions[t[2]]));
    }
    ASSERT_NEAR(std::abs(*value), std::sqrt(best), 1e-6);
  }
  EXPECT_GT(i, 1000U);
}

TEST_F(Volume, TakesTheVoxelFromTheMeanEdge) {
  const auto grid = distances(test::square(2, 0, {0, 0, 0}), {});
  EXPECT_NEAR(stats_.voxel, (4 * 2 + std::sqrt(8)) / 5, 1e-12);
  EXPECT_NEAR(grid->voxelSize().x(), stats_.voxel, 1e-12);
  EXPECT_EQ(grid->indexToWorld(openvdb::Coord(0)), openvdb::Vec3d(0.0));
}

TEST_F(Volume, LeavesTheSignOutForAnOpenMesh) {
  const TriangleMesh square = test::square(2, 0.03, {10, 20, 30});
  const auto grid = distances(square, {.voxel = 0.1});
  EXPECT_FALSE(stats_.has_sign);
  EXPECT_EQ(stats_.boundary_edges, 4U);
  EXPECT_THAT(messages_, HasSubstr("open (4 boundary edges)"));
  EXPECT_EQ(grid->getGridClass(), openvdb::GRID_UNKNOWN);
  for (auto value = grid->cbeginValueOn(); value; ++value) {
    const auto p = grid->indexToWorld(value.getCoord());
    const double dx = std::max(std::abs(p.x()) - 1, 0.0), dy = std::max(std::abs(p.y()) - 1, 0.0), dz = p.z() - 0.03;
    ASSERT_NEAR(*value, std::sqrt(dx * dx + dy * dy + dz * dz), 1e-6);
  }
  EXPECT_FLOAT_EQ(grid->tree().getValue({0, 0, -100}), 0.3F);
  messages_.clear();
  EXPECT_EQ(distances(square, {.voxel = 0.1, .sign = VolumeSign::inside})->getGridClass(), openvdb::GRID_LEVEL_SET);
  EXPECT_THAT(messages_, HasSubstr("counts as outside"));
}

TEST_F(Volume, DropsTheSignOfAClosedMeshWhenAsked) {
  const auto grid = distances(test::sphere(kRadius, 12), {.voxel = 0.1, .sign = VolumeSign::none});
  for (auto value = grid->cbeginValueOn(); value; ++value) ASSERT_GE(*value, 0);
}

TEST_F(Volume, InterpolatesColoursAtTheNearestPoint) {
  for (const auto& [type, range] : {std::pair{ScalarType::uint8, 255.0F}, std::pair{ScalarType::uint16, 65535.0F},
                                    std::pair{ScalarType::float32, 1.0F}}) {
    TriangleMesh mesh = test::sphere(kRadius, kRings);
    colour_by_position(mesh, type, range);
    const auto all = grids(mesh, {.voxel = 0.08});
    ASSERT_EQ(all.size(), 2U);
    EXPECT_TRUE(stats_.has_colours);
    const auto colours = find<openvdb::Vec3SGrid>(all, "Cd");
    ASSERT_NE(colours, nullptr);
    EXPECT_EQ(colours->activeVoxelCount(), stats_.voxels);
    for (auto value = colours->cbeginValueOn(); value; ++value) {
      auto p = colours->indexToWorld(value.getCoord());
      p.normalize();
      for (int k = 0; k < 3; ++k) {
        // The nearest points of polyhedron and sphere lie apart by the faces' tilt over the band.
        ASSERT_NEAR((*value)[k], 0.5 + p[k] / 4, 0.006) << value.getCoord();
      }
    }
    EXPECT_EQ(grids(mesh, {.voxel = 0.08, .colours = false}).size(), 1U);
  }
}

TEST_F(Volume, CarriesNamesAndHalfFloats) {
  TriangleMesh mesh = test::sphere(kRadius, 12);
  colour_by_position(mesh, ScalarType::uint8, 255);
  const auto full = distances(mesh, {.voxel = 0.1});
  const auto full_bytes = stats_.bytes;
  const auto half = distances(mesh, {.voxel = 0.1, .name = "bust", .half = true});
  EXPECT_EQ(full->getName(), "surface");
  EXPECT_EQ(half->getName(), "bust");
  EXPECT_THAT(half->getCreator(), HasSubstr("lamina "));
  EXPECT_TRUE(half->saveFloatAsHalf());
  EXPECT_FALSE(full->saveFloatAsHalf());
  EXPECT_LT(stats_.bytes, full_bytes);
  for (auto value = full->cbeginValueOn(); value; ++value)
    ASSERT_NEAR(half->tree().getValue(value.getCoord()), *value, std::ldexp(0.3, -10));
}

TEST_F(Volume, IsTheSameBytesForAnyNumberOfThreads) {
  TriangleMesh mesh = test::sphere(kRadius, 20, {100, 0, 0});
  colour_by_position(mesh, ScalarType::uint8, 255);
  run_.threads = 1;
  grids(mesh, {.voxel = 0.05});
  const std::string one = test::read_text(path_);
  run_.threads = 4;
  grids(mesh, {.voxel = 0.05});
  EXPECT_TRUE(test::read_text(path_) == one);
  // The tag is a function of the contents, not a constant.
  grids(mesh, {.voxel = 0.06});
  EXPECT_NE(test::read_text(path_).substr(21, 36), one.substr(21, 36));
}

TEST_F(Volume, KeepsGeoreferencedCoordinates) {
  const auto grid = distances(test::sphere(kRadius, kRings, {431000.25, 5213000.5, 800}), {.voxel = 0.06});
  for (auto value = grid->cbeginValueOn(); value; ++value) {
    const double truth =
        (grid->indexToWorld(value.getCoord()) - openvdb::Vec3d(431000.25, 5213000.5, 800)).length() - kRadius;
    ASSERT_NEAR(*value, truth, kSag + 1e-6);
  }
  const auto steps = grid->indexToWorld(openvdb::Coord(0)) / 0.06;
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(steps[k], std::round(steps[k]), 1e-6);
}

TEST_F(Volume, RefusesWhatCannotBeMeant) {
  const TriangleMesh mesh = test::sphere(kRadius, 8);
  const auto code = [&](const TriangleMesh& m, const VolumeSettings& settings, const std::string& path) {
    try {
      write_volume(m, settings, path, run_);
    } catch (const Error& e) {
      return e.code();
    }
    return ExitCode::ok;
  };
  EXPECT_EQ(code(mesh, {.voxel = -1}, path_), ExitCode::usage);
  EXPECT_EQ(code(mesh, {.voxel = 1e-12}, path_), ExitCode::usage);
  EXPECT_EQ(code(test::sphere(1e-4, 8), {.voxel = 1e-5}, path_), ExitCode::usage);
  EXPECT_EQ(code(test::sphere(1e-4, 8), {.voxel = 1.6e-5}, path_), ExitCode::ok);
  std::filesystem::remove(path_);
  EXPECT_EQ(code(mesh, {.band = 0.5}, path_), ExitCode::usage);
  EXPECT_EQ(code(mesh, {.name = "Cd"}, path_), ExitCode::usage);
  EXPECT_EQ(code(mesh, {.voxel = 1e5}, path_), ExitCode::usage) << "larger than the mesh";
  EXPECT_EQ(code(test::sphere(1e5, 8), {.voxel = 3e4, .half = true}, path_), ExitCode::usage);
  EXPECT_EQ(code({}, {}, path_), ExitCode::unreadable);
  TriangleMesh point = mesh;
  for (auto& p : point.positions) p = {1, 1, 1};
  EXPECT_EQ(code(point, {}, path_), ExitCode::empty);
  TriangleMesh beyond = mesh;
  beyond.triangles.back()[2] = static_cast<std::uint32_t>(mesh.positions.size());
  EXPECT_EQ(code(beyond, {}, path_), ExitCode::usage);
  EXPECT_EQ(code(mesh, {}, folder_ / "no/such/out.vdb"), ExitCode::budget);
  // More than any machine has, without anybody naming a limit.
  EXPECT_EQ(code(mesh, {.voxel = 2e-5}, path_), ExitCode::budget);
  EXPECT_EQ(code(mesh, {.voxel = 1e-3, .band = 1000}, path_), ExitCode::budget);
  run_.max_memory = 1 << 20;
  EXPECT_EQ(code(mesh, {.voxel = 0.005}, path_), ExitCode::budget);
  EXPECT_EQ(code(mesh, {.voxel = 0.3}, path_), ExitCode::ok);
  const std::atomic<bool> cancel = true;
  run_.cancel = &cancel;
  std::filesystem::remove(path_);
  EXPECT_EQ(code(mesh, {}, path_), ExitCode::internal);
  EXPECT_TRUE(std::filesystem::is_empty(folder_.path())) << "something was left behind";
}

}  // namespace
}  // namespace lamina

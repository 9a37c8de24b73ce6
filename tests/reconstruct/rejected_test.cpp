// The samples left out, as a cloud of their own.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "lamina/chunk.h"
#include "lamina/error.h"
#include "lamina/points.h"
#include "reconstruct/clouds.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;

constexpr std::size_t kSurface = 8000, kDust = 60;

/// A sphere, lone samples far from it, and each sample's number as its `id`.
Cloud dusty_sphere() {
  Cloud cloud = test::sphere_cloud(kSurface);
  std::mt19937 random(8);
  std::uniform_real_distribution<> far(1.5, 3);
  for (std::size_t i = 0; i < kDust; ++i) {
    Point3 p = test::random_direction(random);
    const double by = far(random);
    for (double& c : p) c *= by;
    cloud.add(p, test::random_direction(random));
  }
  double id = 0;
  cloud.add_property("id", ScalarType::uint32, [&](const Point3&) { return id++; });
  return cloud;
}

SampleBatch all_rows(const std::string& path, PointSourceInfo& info) {
  const std::unique_ptr<PointSource> source = open_points(path);
  info = source->info();
  SampleBatch rows;
  source->read(0, info.count, rows);
  return rows;
}

class RejectedSamples : public ::testing::Test {
 protected:
  RejectedSamples() {
    settings_.input = test::write_cloud(cloud_, folder_ / "in.ply");
    settings_.output = folder_ / "out.ply";
    settings_.rejected = folder_ / "left_out.ply";
    settings_.clean.strays = true;
  }
  test::TemporaryFolder folder_;
  const Cloud cloud_ = dusty_sphere();
  SurfaceSettings settings_;
};

TEST(Duplicates, AreLeftOutWhereThereAreMany) {
  // A file saved twice into one: every count of samples is twice what the surface shows.
  const Cloud once = test::sphere_cloud(kSurface);
  Cloud twice = once;
  for (std::size_t i = 0; i < once.size(); ++i) twice.add(once.positions[i], once.normals[i]);
  SurfaceSettings settings;
  settings.clean.strays = true;
  const test::Reconstruction alone = reconstruct(once, settings);
  EXPECT_EQ(alone.stats.cleaned.merged, 0U);
  const test::Reconstruction r = reconstruct(twice, settings);
  EXPECT_EQ(r.stats.cleaned.merged, kSurface);
  EXPECT_TRUE(r.facts.is_closed_manifold());
  EXPECT_NEAR(static_cast<double>(r.mesh.triangles.size()), static_cast<double>(alone.mesh.triangles.size()),
              0.02 * static_cast<double>(alone.mesh.triangles.size()));
  // Both faces of a sheet without thickness are no duplicates.
  Cloud sheet = test::plane_cloud(kSurface);
  const std::size_t face = sheet.size();
  for (std::size_t i = 0; i < face; ++i) {
    const Point3& n = sheet.normals[i];
    sheet.add(sheet.positions[i], {-n[0], -n[1], -n[2]});
  }
  SurfaceSettings believing = settings;
  believing.normals = NormalsChoice::file;
  EXPECT_EQ(reconstruct(sheet, believing).stats.cleaned.merged, 0U);
  // Nor are samples left out that nobody wants cleaned.
  EXPECT_EQ(reconstruct(twice, {}).stats.cleaned.merged, 0U);
}

TEST_F(RejectedSamples, AreThoseOfTheInput) {
  const SurfaceStats stats = reconstruct_surface(settings_, {});
  PointSourceInfo info;
  const SampleBatch rows = all_rows(settings_.rejected, info);
  ASSERT_EQ(rows.size(), stats.cleaned.lonely + stats.cleaned.off_surface);
  EXPECT_GE(rows.size(), kDust * 9 / 10);
  ASSERT_EQ(info.attributes.size(), 2U);
  EXPECT_EQ(info.attributes[0].name, "id");
  EXPECT_EQ(info.attributes[1].name, "reason");
  std::map<float, std::uint64_t> reasons;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto id = static_cast<std::size_t>(rows.attributes[0][i]);
    ASSERT_LT(id, cloud_.size());
    const Point3 &p = cloud_.positions[id], &n = cloud_.normals[id];
    EXPECT_LT(test::length({rows.x[i] - p[0], rows.y[i] - p[1], rows.z[i] - p[2]}), 1e-6);
    EXPECT_LT(test::length({rows.nx[i] - n[0], rows.ny[i] - n[1], rows.nz[i] - n[2]}), 1e-5);
    ++reasons[rows.attributes[1][i]];
  }
  EXPECT_EQ(reasons[3], stats.cleaned.lonely);
  EXPECT_EQ(reasons[4], stats.cleaned.off_surface);
}

TEST_F(RejectedSamples, AreTheSameEveryTime) {
  settings_.clean.merge = 0.01;
  settings_.clean.sigma = 3;
  settings_.clean.spacing = 0.02;
  std::set<std::string> bytes, meshes;
  for (const int threads : {1, 4}) {
    RunContext run;
    run.threads = threads;
    const SurfaceStats stats = reconstruct_surface(settings_, run);
    bytes.insert(test::read_file(settings_.rejected));
    meshes.insert(test::read_file(settings_.output));
    const CleanCounts& c = stats.cleaned;
    PointSourceInfo info;
    all_rows(settings_.rejected, info);
    EXPECT_EQ(info.count, c.merged + c.outliers + c.lonely + c.off_surface + c.thinned);
  }
  settings_.rejected.clear();
  reconstruct_surface(settings_, {});
  meshes.insert(test::read_file(settings_.output));
  EXPECT_EQ(bytes.size(), 1U);
  EXPECT_EQ(meshes.size(), 1U) << "the mesh does not know";
}

TEST_F(RejectedSamples, AreAnEmptyFileWhereNoneAre) {
  settings_.clean.strays = false;
  reconstruct_surface(settings_, {});
  PointSourceInfo info;
  EXPECT_EQ(all_rows(settings_.rejected, info).size(), 0U);
}

TEST_F(RejectedSamples, LeaveNothingWhenTheRunFails) {
  settings_.prune_triangles = 100'000'000;
  EXPECT_THROW(reconstruct_surface(settings_, {}), Error);
  EXPECT_FALSE(std::filesystem::exists(settings_.rejected));
  EXPECT_EQ(folder_.entries(), 1U);
}

TEST_F(RejectedSamples, AreRefusedWhereTheyCannotBe) {
  const auto refused = [](const SurfaceSettings& s) {
    try {
      reconstruct_surface(s, {});
    } catch (const Error& error) {
      return error.code() == ExitCode::usage || error.code() == ExitCode::budget;
    }
    return false;
  };
  SurfaceSettings s = settings_;
  s.rejected = s.output;
  EXPECT_TRUE(refused(s));
  s.rejected = s.input;
  EXPECT_TRUE(refused(s));
  s.rejected = folder_ / "left_out.docx";
  EXPECT_TRUE(refused(s));
  s.rejected = folder_ / "nowhere/left_out.ply";
  EXPECT_TRUE(refused(s));
  const std::string store = folder_ / "store";
  SurfaceSettings kept = settings_;
  kept.rejected.clear();
  write_store(kept, store, {});
  s = settings_;
  s.input = store;
  EXPECT_TRUE(refused(s));
  s.output = folder_ / "part";
  EXPECT_THROW(reconstruct_chunk(s, {1, 2}, {}), Error);
  Cloud taken = test::sphere_cloud(500);
  taken.add_property("reason", ScalarType::uint8, [](const Point3&) { return 1.0; });
  s = settings_;
  s.input = test::write_cloud(taken, folder_ / "taken.ply");
  EXPECT_TRUE(refused(s));
}

}  // namespace
}  // namespace lamina

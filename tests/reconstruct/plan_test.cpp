#include "reconstruct/plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lamina/error.h"
#include "reconstruct/clouds.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;
using test::reconstruct;

SurfacePlan plan_of(
    const Cloud& cloud, const std::function<void(SurfaceSettings&)>& change = [](auto&) {}) {
  const test::TemporaryFolder folder;
  SurfaceSettings s;
  s.input = test::write_cloud(cloud, folder / "in.ply");
  s.dry_run = true;
  s.blend = 1.2;
  change(s);
  RunContext run;
  run.tmp_dir = folder.path();
  const SurfaceStats stats = reconstruct_surface(s, run);
  EXPECT_EQ(folder.entries(), 1);
  return stats.plan;
}

TEST(SurfacePlan, DescribesTheCloud) {
  const Cloud cloud = test::torus_cloud(20000);
  const SurfacePlan plan = plan_of(cloud);
  EXPECT_EQ(plan.samples, 20000u);
  // The axis of revolution is the shortest; the sweep goes across it. Frames are tilted by some degrees.
  EXPECT_NEAR(plan.extent[0], 0.8, 2 * std::sin(0.06));
  EXPECT_NEAR(plan.extent[2], 2.8, 0.02);
  const double spacing = std::sqrt(4 * std::numbers::pi * std::numbers::pi * 0.4 / 20000);
  EXPECT_NEAR(plan.radius_median, 2 * spacing, 0.4 * spacing);
  EXPECT_LE(plan.radius_low, plan.radius_median);
  EXPECT_GE(plan.radius_high, plan.radius_median);
  EXPECT_GE(plan.levels, 1);
  EXPECT_NEAR(plan.slab_height, plan.finest_cell * std::exp2(plan.levels - 1), 1e-9);
  EXPECT_NEAR(static_cast<double>(plan.slabs), plan.extent[2] / plan.slab_height, 2);
}

TEST(SurfacePlan, LevelsFollowTheSpreadOfRadii) {
  const auto varying = [](double octaves) {
    return test::sphere_cloud(20000, [=](const Point3& v) { return std::exp2(octaves * (v[2] - 1)); });
  };
  EXPECT_LE(plan_of(varying(0)).levels, 4);
  EXPECT_GT(plan_of(varying(6)).levels, 4);
  EXPECT_EQ(plan_of(varying(6), [](auto& s) { s.levels = 3; }).levels, 3);
  EXPECT_EQ(plan_of(varying(0), [](auto& s) { s.levels = 5; }).levels, 5);
}

// Samples fill them: memory must not grow with the blending factor.
TEST(SurfacePlan, SlabsAreAsHighAsSoManyRadii) {
  const Cloud cloud = test::sphere_cloud(20000);
  for (const double blend : {0.5, 1.0, 1.2, 2.0, 4.0}) {
    const SurfacePlan plan = plan_of(cloud, [&](auto& s) { s.blend = blend; });
    EXPECT_LE(plan.slab_height, 4.6 * plan.radius_median) << blend;
    EXPECT_GE(plan.slab_height, 2 * plan.radius_median) << blend;
  }
}

TEST(SurfacePlan, CellsFollowTheSettings) {
  const Cloud cloud = test::sphere_cloud(20000);
  const double finest = plan_of(cloud).finest_cell;
  EXPECT_NEAR(plan_of(cloud, [](auto& s) { s.blend = 2.4; }).finest_cell, 2 * finest, 0.01 * finest);
  EXPECT_NEAR(plan_of(cloud, [](auto& s) { s.radius_scale = 2; }).finest_cell, 2 * finest, 0.01 * finest);
  const auto in_r = [](double blend) {
    return [blend](auto& s) {
      s.cell = {1, Length::Unit::sample_radius};
      s.blend = blend;
    };
  };
  EXPECT_EQ(plan_of(cloud, in_r(1)).finest_cell, plan_of(cloud, in_r(2)).finest_cell);
  EXPECT_NEAR(plan_of(cloud, [](auto& s) { s.cell = {0.05, Length::Unit::world}; }).finest_cell, 0.05, 1e-6);
}

// Half the samples at one place say nothing of how densely the other half lies.
TEST(SurfacePlan, CoincidentSamplesDoNotSetTheScale) {
  Cloud cloud = test::sphere_cloud(5000);
  const double alone = plan_of(cloud).radius_median;
  for (int i = 0; i < 5000; ++i) cloud.add(cloud.positions[0], cloud.normals[0]);
  EXPECT_NEAR(plan_of(cloud).radius_median, alone, 0.1 * alone);
  const auto r = reconstruct(cloud);
  EXPECT_TRUE(r.facts.is_manifold());
  EXPECT_LT(test::deviation(r.mesh, test::distance_to_sphere).largest, 0.02);
  EXPECT_NEAR(test::area(r.mesh), 4 * std::numbers::pi, 0.3);
}

TEST(SurfacePlan, CountsTiles) {
  const Cloud cloud = test::torus_cloud(20000);
  const SurfacePlan without = plan_of(cloud);
  const SurfacePlan with = plan_of(cloud, [](auto& s) { s.tiles.folder = "tiles"; });
  EXPECT_GT(with.memory_bytes, without.memory_bytes);
  EXPECT_GE(with.disk_bytes, without.disk_bytes);
  EXPECT_GT(with.disk_bytes, 12 * cloud.size());  // its triangles, of which there are more, beside the mesh
}

// What was expected is what it took, within a factor that a user can plan with.
TEST(SurfacePlan, ExpectsTheDiskItTakes) {
  const Cloud cloud = test::sphere_cloud(30000);
  const std::vector<std::function<void(SurfaceSettings&)>> changes{
      [](auto&) {}, [](auto& s) { s.cluster = ClusterMode::none; }, [](auto& s) { s.blend = 2; },
      [](auto& s) {
        s.cell = {0.02, Length::Unit::world};
      }};
  for (const auto& change : changes) {
    SurfaceSettings s;
    change(s);
    const auto stats = reconstruct(cloud, s).stats;
    EXPECT_GT(static_cast<double>(stats.plan.disk_bytes), 0.7 * static_cast<double>(stats.disk_bytes));
    EXPECT_LT(static_cast<double>(stats.plan.disk_bytes), 1.5 * static_cast<double>(stats.disk_bytes));
  }
}

// Of large clouds they are lower: the radii are given here, so that few samples fill a slab.
TEST(SurfacePlan, SlabsHoldOnlySoManySamples) {
  const auto plan = [](std::size_t samples) {
    Cloud cloud = test::sphere_cloud(samples);
    cloud.add_property("radius", ScalarType::float32, [](const Point3&) { return 0.25; });
    return plan_of(cloud);
  };
  const SurfacePlan few = plan(50'000);
  const SurfacePlan many = plan(200'000);
  EXPECT_EQ(many.levels, few.levels - 1);
  EXPECT_NEAR(many.finest_cell, few.finest_cell, 0.01 * few.finest_cell);
  EXPECT_NEAR(many.slab_height, few.slab_height / 2, 0.01 * few.slab_height);
}

TEST(SurfacePlan, MemoryGrowsWithTheWindowAndShrinksWithTheCells) {
  const Cloud cloud = test::sphere_cloud(30000);
  const auto memory = [&](int window, double blend) {
    return plan_of(cloud,
                   [=](auto& s) {
                     s.window = window;
                     s.blend = blend;
                   })
        .memory_bytes;
  };
  EXPECT_LT(memory(1, 1), memory(4, 1));
  EXPECT_GT(memory(1, 1), memory(1, 4));
}

TEST(SurfacePlan, CountsTheVolume) {
  const Cloud cloud = test::sphere_cloud(30000);
  const auto memory = [&](const std::string& volume) {
    return plan_of(cloud, [&](auto& s) { s.volume.path = volume; }).memory_bytes;
  };
  EXPECT_GT(memory("out.vdb"), memory("") + 1'000'000);
}

// Or the mesh would differ with a volume beside it.
TEST(SurfacePlan, TheVolumeDoesNotChooseTheLevels) {
  Cloud cloud = test::sphere_cloud(20000);
  cloud.add_property("heat", ScalarType::float32, [](const Point3& p) { return p[2]; });
  const auto without = plan_of(cloud, [](auto& s) { s.frame = FrameMode::axis; });
  const auto with = plan_of(cloud, [](auto& s) {
    s.volume.path = "unused.vdb";
    s.volume.grids.assign(300, "heat");
  });
  constexpr std::uint64_t kRoomy = std::uint64_t{224} << 20;
  ASSERT_LT(without.memory_bytes, kRoomy);
  ASSERT_GT(with.memory_bytes, kRoomy);
  EXPECT_EQ(with.levels, without.levels);
  EXPECT_EQ(with.finest_cell, without.finest_cell);
  EXPECT_EQ(with.slab_height, without.slab_height);
}

TEST(SurfacePlan, TimeGrowsWithSamplesStepsAndCells) {
  const auto seconds = [](std::size_t samples, const std::function<void(SurfaceSettings&)>& change) {
    SurfaceSettings s;
    s.blend = 1.2;
    change(s);
    ReconstructionPlan plan;
    plan.feed.blend = *s.blend;
    plan.projection.steps = s.steps;
    plan.volume = s.volume;
    plan.samples = samples;
    plan.radius.median = 1000;
    plan.lattice.cell = static_cast<std::int32_t>(0.63 * *s.blend * 1000);
    return expected_cpu_seconds(plan);
  };
  const auto as_it_is = [](auto&) {};
  const double once = seconds(1'000'000, as_it_is);
  EXPECT_GT(once, 0);
  EXPECT_NEAR(seconds(3'000'000, as_it_is), 3 * once, 1e-9 * once);
  EXPECT_GT(seconds(1'000'000, [](auto& s) { s.steps = 4; }), 1.3 * once);
  const auto volume = [](double band) {
    return [band](auto& s) {
      s.volume.path = "out.vdb";
      s.volume.band = band;
    };
  };
  EXPECT_GT(seconds(1'000'000, volume(3)), 1.1 * once);
  EXPECT_GT(seconds(1'000'000, volume(6)), seconds(1'000'000, volume(3)));
  // Larger cells are fewer, and what a sample costs whatever the cells remains.
  const double coarse = seconds(1'000'000, [](auto& s) { s.blend = 4; });
  EXPECT_LT(coarse, 0.8 * once);
  EXPECT_LT(std::abs(coarse - seconds(1'000'000, [](auto& s) { s.blend = 8; })), 0.1 * coarse);
}

// Not the time: it goes with how fast the input was read.
TEST(SurfacePlan, CountsNormalsFittedAgain) {
  const Cloud cloud = test::sphere_cloud(20000);
  const SurfacePlan kept = plan_of(cloud);
  const SurfacePlan near = plan_of(cloud, [](auto& s) { s.refit = 1; });
  const SurfacePlan far = plan_of(cloud, [](auto& s) { s.refit = 8; });
  EXPECT_GT(near.memory_bytes, kept.memory_bytes);
  EXPECT_GT(far.memory_bytes, near.memory_bytes);
  EXPECT_EQ(far.finest_cell, kept.finest_cell);
}

TEST(SurfacePlan, IsDescribedInWords) {
  SurfacePlan plan;
  plan.samples = 1234;
  plan.levels = 5;
  plan.finest_cell = 0.5;
  plan.slabs = 77;
  plan.slab_height = 8;
  plan.memory_bytes = 123'000'000;
  plan.disk_bytes = 45'000'000;
  plan.blend = 1.5;
  const std::string text = describe(plan);
  for (const char* words :
       {"samples 1234", "levels 5", "cells 0.5 to 8", "slabs 77 of 8", "R = 1.5 r", "memory 123 MB", "disk 45 MB"}) {
    EXPECT_THAT(text, ::testing::HasSubstr(words));
  }
}

}  // namespace
}  // namespace lamina

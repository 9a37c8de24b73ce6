#include "mls/project.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <set>

#include "mls/mls_truth.h"
#include "support/random_cloud.h"
#include "support/streamed_cloud.h"
#include "support/window_contents.h"

namespace lamina::test {
namespace {

struct Scene {
  const char* name = "";
  CloudSettings cloud;
  Lattice lattice{64, 3};
  FeedSettings feed;
  ProjectSettings project;
  std::int32_t bucket_height = 97;
  std::uint64_t seed = 1;
};

/// How much of a scene could be compared; the rest lies at a switch or is ill-conditioned beyond floats.
struct Share {
  std::size_t points = 0, seen = 0, trusted = 0, compared = 0, undecided = 0, rough = 0;
};

ProjectCounts project_all(StreamedCloud& s, const ProjectSettings& settings, const Kernel& kernel) {
  Projector projector(settings, kernel);
  for (std::int32_t slab = s.first; slab < s.end; ++slab) projector.project(s.window, slab, s.feed);
  return projector.counts();
}

/// The corners, or centres, of every level that are to be projected.
std::vector<std::set<Cell>> worth_projecting(const StreamedCloud& s, bool centres) {
  std::vector<std::set<Cell>> out;
  for (int level = 0; level < s.window.levels(); ++level) {
    out.push_back({});
    for_set(s.window, level, s.first, s.end, centres ? &CornerBlock::cells : &CornerBlock::corners,
            [&](int, const Cell& c, const CornerBlock& leaf, int offset) {
              std::array<std::uint64_t, 8> close{};
              close_cells(leaf, 0, 8, close.data());
              if (centres ? ((close[static_cast<std::size_t>(offset >> 6)] >> (offset & 63)) & 1U) != 0
                          : leaf.active.test(offset)) {
                out.back().insert(c);
              }
            });
  }
  return out;
}

/// One point's masks and values against the truth.
void compare(const Window& window, int level, const Projected& points, int offset, const TruthValue& truth,
             const ProjectSettings& settings, Share& share) {
  ++share.points;
  share.seen += points.seen.test(offset) ? 1 : 0;
  share.trusted += points.trusted.test(offset) ? 1 : 0;
  ASSERT_TRUE(points.seen.test(offset) || !points.trusted.test(offset));
  if (truth.undecided) {
    ++share.undecided;
    return;
  }
  const bool has_normal = dot(truth.normal, truth.normal) > 0;
  ASSERT_EQ(points.seen.test(offset), truth.weight > 0 && has_normal && truth.nearest <= 1)
      << "weight " << truth.weight << " nearest " << truth.nearest << " contributing " << truth.seen;
  ASSERT_EQ(points.active.test(offset), points.seen.test(offset)) << "values for what is seen";
  if (!points.seen.test(offset)) return;
  const double cell = window.lattice().cell_size(level);
  if (!(truth.distance_error < 0.01 * cell && truth.normal_error < 0.01)) {
    ++share.rough;
    return;
  }
  ++share.compared;
  if (std::abs(truth.offset_from_mean - settings.trusted_offset) > truth.offset_error) {
    ASSERT_EQ(points.trusted.test(offset),
              truth.offset_from_mean <= settings.trusted_offset && truth.seen >= settings.trusted_samples)
        << "offset " << truth.offset_from_mean << " of " << truth.seen;
  }
  const CornerValues& values = points.values[window.slab_in_leaf(level, offset >> 6)];
  const std::uint32_t i = points.value_index(offset, window.slab_layers(level));
  ASSERT_LT(i, values.count);
  const double away = std::sqrt(dot(truth.from_average, truth.from_average));
  if (settings.centres || points.trusted.test(offset) || away < 0.01 * cell) {
    ASSERT_NEAR(values.channel(kDistance)[i], truth.distance, truth.distance_error);
    for (int k = 0; k < 3; ++k) ASSERT_NEAR(values.channel(kNormalX + k)[i], truth.normal[k], truth.normal_error);
    ASSERT_NEAR(values.channel(kCurvature)[i], truth.curvature, truth.curvature_error);
  } else {  // what is not trusted keeps to its samples: the average itself, on the fit's side
    const double distance = values.channel(kDistance)[i];
    ASSERT_NEAR(std::abs(distance), away, 5e-3 * cell);
    if (std::abs(truth.distance) > truth.distance_error) {
      ASSERT_EQ(distance < 0, truth.distance < 0);
    }
    for (int k = 0; k < 3; ++k)
      ASSERT_NEAR(distance * values.channel(kNormalX + k)[i], truth.from_average[k], 5e-3 * cell);
    ASSERT_EQ(values.channel(kCurvature)[i], 0);
  }
  // What sees a single sample is as far from it as to stand on nothing of its own.
  const bool alone = !settings.centres && !points.trusted.test(offset) && truth.seen < 2;
  ASSERT_NEAR(values.channel(kOffsetFromMean)[i],
              alone ? std::max(1.0, truth.offset_from_mean) : truth.offset_from_mean, truth.offset_error);
  for (int c = 0; c < window.attributes(); ++c) {
    ASSERT_NEAR(values.channel(kFirstAttribute + c)[i], truth.attributes[c], truth.attribute_errors[c]);
  }
}

/// Every point worth projecting, at every level, against the truth.
void expect_truth(const Scene& scene, Share& share) {
  const LocalSamples cloud = random_cloud(scene.cloud, scene.seed);
  StreamedCloud s(cloud, scene.lattice, scene.feed, scene.bucket_height);
  const auto worth = worth_projecting(s, scene.project.centres);
  const ProjectCounts counts = project_all(s, scene.project, select_kernel());
  const MlsTruth truth(truth_samples(cloud, scene.lattice, scene.feed), scene.project);
  const double shift = scene.project.centres ? 0.5 : 0.0;
  ProjectCounts own;
  for (int level = 0; level < scene.lattice.levels; ++level) {
    const auto visit = [&](int, const Cell& c, const CornerBlock& leaf, int offset) {
      if (testing::Test::HasFatalFailure()) return;
      const Projected* points = scene.project.centres ? leaf.centres.get() : &leaf;
      const bool wanted = worth[static_cast<std::size_t>(level)].contains(c);
      if (points == nullptr) {
        ASSERT_FALSE(wanted) << "no centres";
        return;
      }
      if (!wanted) {
        ASSERT_FALSE(points->seen.test(offset) || points->trusted.test(offset));
        return;
      }
      // The finest level that holds a corner is where it is projected.
      const bool corner = !scene.project.centres;
      const std::int64_t slab = scene.lattice.slab_of_layer(level, c.z);
      const std::int64_t height = scene.lattice.slab_height();
      const float margin = Projector(scene.project, select_kernel()).margin(scene.lattice);
      if (!corner || !leaf.shared.test(offset)) {
        // Without a sample in reach of its slab a corner is not looked at.
        own.corners += s.feed.batches(slab * height, (slab + 1) * height, margin).empty() ? 0 : 1;
        own.seen += points->seen.test(offset) ? 1 : 0;
        own.trusted += points->trusted.test(offset) ? 1 : 0;
      }
      int from = level;
      Cell fine = c;
      while (corner && from > 0 && s.window.probe(from, block_of(fine))->shared.test(offset_in_block(fine))) {
        const HeldCorner held = held_finer(s.window, from, fine);
        fine = held.corner;
        from = held.level;
      }
      const double cell = scene.lattice.cell_size(level);
      const Vec3 at{(c.x + shift) * cell, (c.y + shift) * cell, (c.z + shift) * cell};
      compare(s.window, level, *points, offset, truth.value(at, scene.lattice.cell_size(from)), scene.project, share);
      ASSERT_FALSE(testing::Test::HasFatalFailure()) << scene.name << ", seed " << scene.seed << ", level " << level
                                                     << " (" << c.x << ", " << c.y << ", " << c.z << ")";
    };
    if (scene.project.centres) {
      for_set(s.window, level, s.first, s.end, &CornerBlock::cells, visit);
    } else {
      for_set(s.window, level, s.first, s.end, &CornerBlock::corners, visit);
    }
  }
  EXPECT_EQ(counts.corners, own.corners);
  EXPECT_EQ(counts.seen, own.seen);
  EXPECT_EQ(counts.trusted, own.trusted);
}

/// Shapes, levels, qualities, attributes, supports: what the projection can meet.
std::vector<Scene> scenes() {
  std::vector<Scene> out;
  const auto add = [&](const char* name) -> Scene& {
    out.push_back({});
    out.back().name = name;
    out.back().seed = out.size();
    return out.back();
  };
  add("sphere, one level").cloud = {Shape::sphere, 300, {0, 0, 0}, 400};
  {
    Scene& s = add("sphere, three levels, quality, colours");
    s.cloud = {Shape::sphere, 500, {-900, 300, 1200}, 600, 70, 300};
    s.cloud.quality = true;
    s.cloud.attributes = 3;
  }
  {
    Scene& s = add("noisy torus, H = 2, one attribute");
    s.cloud = {Shape::torus, 350, {5000, -7000, -3333}, 700, 80, 120};
    s.cloud.noise = 0.15;
    s.cloud.attributes = 1;
    s.feed.blend = 2;
    s.lattice = {96, 4};
  }
  {
    Scene& s = add("plane, some samples left out");
    s.cloud = {Shape::plane, 300, {100, 100, 100}, 700, 80, 400};
    s.feed.max_radius = 300;
    s.lattice = {61, 4};
  }
  {
    Scene& s = add("scatter, far from the origin");
    s.cloud = {Shape::scatter, 150, {900'000'000, -1'200'000'000, 700'000'000}, 500, 100, 300};
    s.lattice = {70, 4};
  }
  {
    Scene& s = add("supports much larger than cells");
    s.cloud = {Shape::sphere, 110, {0, 0, 0}, 350, 90, 130};
    s.feed.blend = 4;
    s.feed.cell.unit = Length::Unit::sample_radius;
    s.lattice = {50, 2};
  }
  {
    Scene& s = add("a band of radii where cells are small, of cells where they are not");
    s.cloud = {Shape::sphere, 250, {10, 0, 0}, 350, 60, 160};
    s.feed.blend = 1.5;
    s.feed.cell = {0.7, Length::Unit::sample_radius};
    s.feed.band_cells = 1.5F;
    s.feed.band_radii = 0.8F;
    s.lattice = {60, 3};
  }
  {
    Scene& s = add("fixed cell");
    s.cloud = {Shape::sphere, 250, {33, 44, 55}, 350, 100, 160};
    s.feed.cell = {1, Length::Unit::world};
    s.lattice = {90, 3};
  }
  return out;
}

void run(const std::vector<Scene>& scenes, Fit fit, int steps, bool centres = false) {
  for (Scene scene : scenes) {
    scene.project.fit = fit;
    scene.project.steps = steps;
    scene.project.centres = centres;
    scene.project.sheets = 0;  // the definition knows no sides
    Share share;
    expect_truth(scene, share);
    if (testing::Test::HasFatalFailure()) return;
    EXPECT_GT(share.seen, 500U) << scene.name;
    EXPECT_GT(share.trusted, share.seen / 4) << scene.name;
    EXPECT_LT(share.undecided, share.points / 100 + 10) << scene.name;
    EXPECT_LT(share.rough, share.seen / 20) << scene.name;
  }
}

TEST(Project, PlaneFitIsTheDefinition) {
  run(scenes(), Fit::plane, 1);
}

TEST(Project, SphereFitIsTheDefinition) {
  run(scenes(), Fit::sphere, 1);
}

TEST(Project, TwoAndThreeStepsAreTheDefinition) {
  std::vector<Scene> all = scenes();
  run(all, Fit::sphere, 2);
  all.erase(all.begin() + 3, all.end());
  run(all, Fit::plane, 2);
  run(all, Fit::sphere, 3);
}

TEST(Project, CellCentresAreTheDefinition) {
  run(scenes(), Fit::sphere, 1, true);
  run(scenes(), Fit::plane, 2, true);
}

TEST(Project, SeveralBatchesAreTheDefinition) {
  std::vector<Scene> all = scenes();
  for (Scene& s : all) {
    s.feed.batch_samples = 20;
    s.feed.cache_bytes = 1;
  }
  run(all, Fit::sphere, 1);
  all.erase(all.begin(), all.begin() + 4);
  run(all, Fit::sphere, 3);
}

/// Bits of everything that projection leaves behind.
std::vector<std::uint64_t> bits_of(const Scene& scene, const Kernel& kernel, int threads) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  StreamedCloud s(random_cloud(scene.cloud, scene.seed), scene.lattice, scene.feed, scene.bucket_height);
  project_all(s, scene.project, kernel);
  return all_bits(s.window, s.first, s.end);
}

TEST(Project, KernelsAndThreadsGiveTheSameBits) {
  for (const Scene& base : scenes()) {
    for (const int steps : {1, 2}) {
      Scene scene = base;
      scene.project.steps = steps;
      scene.project.fit = steps == 1 ? Fit::sphere : Fit::plane;
      const std::vector<std::uint64_t> bits = bits_of(scene, available_kernels().front(), 1);
      for (const Kernel& kernel : available_kernels()) {
        for (const int threads : {1, 2, 4}) {
          ASSERT_TRUE(bits_of(scene, kernel, threads) == bits)
              << scene.name << ", " << kernel.name << ", " << threads << " threads, " << steps << " steps";
        }
      }
    }
  }
}

TEST(Project, BatchesCutBetweenSlabsGiveTheSameBits) {
  // Buckets that end where slabs do keep every corner's sums in the same order, however they are batched.
  // Supports of more than four cells are the exception: rows of samples farther than that from a tile are one.
  for (const Scene& base : scenes()) {
    if (base.feed.blend > 2) continue;
    for (const int steps : {1, 3}) {
      Scene scene = base;
      scene.project.steps = steps;
      scene.bucket_height = scene.lattice.slab_height();
      const std::vector<std::uint64_t> bits = bits_of(scene, select_kernel(), 2);
      scene.feed.batch_samples = 1;
      ASSERT_TRUE(bits_of(scene, select_kernel(), 2) == bits) << scene.name << ", " << steps << " steps";
      scene.feed.cache_bytes = 1;
      ASSERT_TRUE(bits_of(scene, select_kernel(), 2) == bits) << scene.name << ", " << steps << " steps";
    }
  }
}

TEST(Project, PlaneSamplesGiveTheirPlane) {
  // Analytic: whatever the weights, samples of one plane answer its distance, up to their rounding to steps.
  Scene scene;
  scene.cloud = {Shape::plane, 900, {0, 0, 0}, 6000, 1500, 1500};
  scene.lattice = {1024, 3};
  const LocalSamples cloud = random_cloud(scene.cloud, 5);
  const Vec3 n{cloud.nx[0], cloud.ny[0], cloud.nz[0]};
  for (const Fit fit : {Fit::plane, Fit::sphere}) {
    StreamedCloud s(cloud, scene.lattice, scene.feed, 500);
    scene.project.fit = fit;
    project_all(s, scene.project, select_kernel());
    std::size_t trusted = 0;
    for_set(s.window, 0, s.first, s.end, &CornerBlock::trusted,
            [&](int, const Cell& c, const CornerBlock& leaf, int offset) {
              const CornerValues& v = leaf.values[s.window.slab_in_leaf(0, offset >> 6)];
              const std::uint32_t i = leaf.value_index(offset, s.window.slab_layers(0));
              const Vec3 at{c.x * 1024.0, c.y * 1024.0, c.z * 1024.0};
              ++trusted;
              ASSERT_NEAR(v.channel(kDistance)[i], dot(n, at), fit == Fit::plane ? 1.5 : 4.0);
              ASSERT_NEAR(v.channel(kCurvature)[i], 0, 2e-6);
            });
    EXPECT_GT(trusted, 300U);
  }
}

}  // namespace
}  // namespace lamina::test

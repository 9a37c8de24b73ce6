// What fits leave of their samples: found with the normals, and added where it is more than noise.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>

#include "mls/project.h"
#include "mls/tile_values.h"
#include "support/random_cloud.h"
#include "support/streamed_cloud.h"
#include "support/window_contents.h"

namespace lamina::test {
namespace {

constexpr Lattice kLattice{1024, 3};
constexpr double kRadius = 1500;

/// The normals that came, and a residual for each sample by its number in the bucket.
class GivenResiduals final : public NormalFilter {
 public:
  explicit GivenResiduals(std::function<float(std::size_t)> residual) : residual_(std::move(residual)) {}
  [[nodiscard]] double halo() const override { return 1; }
  void add(std::size_t bucket, const LocalSamples& samples, const std::vector<float>& /*radii*/) override {
    FilteredNormals& n = added_[bucket] = {samples.nx, samples.ny, samples.nz, {}};
    for (std::size_t i = 0; i < samples.size(); ++i) n.residual.push_back(residual_(i));
  }
  FilteredNormals find(std::size_t bucket) override { return added_.at(bucket); }
  void forget_below(std::int64_t /*z*/) override {}

 private:
  std::function<float(std::size_t)> residual_;
  std::map<std::size_t, FilteredNormals> added_;
};

/// A trusted corner's distance from the surface, and how far aside its samples' mean lies (support radii).
struct Found {
  Cell corner;
  double distance = 0, offset = 0, attribute = 0;
};

/// Corners of the finest level on a plane whose samples have residuals.
std::vector<Found> project_plane(int attributes, const std::function<float(std::size_t)>& residual) {
  CloudSettings settings{Shape::plane, 900, {0, 0, 0}, 6000, kRadius, kRadius};
  settings.radius_spread = 1;
  settings.attributes = attributes;
  const LocalSamples cloud = random_cloud(settings, 5);
  GivenResiduals filter(residual);
  StreamedCloud s(cloud, kLattice, {}, 500, &filter);
  ProjectSettings project;
  project.residuals = true;
  Projector projector(project, select_kernel());
  for (std::int32_t slab = s.first; slab < s.end; ++slab) projector.project(s.window, slab, s.feed);
  std::vector<Found> out;
  for_set(s.window, 0, s.first, s.end, &CornerBlock::trusted,
          [&](int, const Cell& c, const CornerBlock& leaf, int offset) {
            const CornerValues& v = leaf.values[s.window.slab_in_leaf(0, offset >> 6)];
            const std::uint32_t i = leaf.value_index(offset, s.window.slab_layers(0));
            out.push_back({c, v.channel(kDistance)[i], v.channel(kOffsetFromMean)[i],
                           attributes > 0 ? v.channel(kFirstAttribute)[i] : 0.0});
          });
  return out;
}

TEST(Residuals, ThatAgreeMoveTheSurfaceWhereSamplesLieAround) {
  constexpr double kResidual = 60, kLarge = kResidual / (kMostResidual * kRadius);
  const double taken = std::pow(1 - kLarge * kLarge, 2) * kResidual;
  for (const int attributes : {0, 1, 3}) {
    const std::vector<Found> before = project_plane(attributes, [](std::size_t) { return 0.0F; });
    const std::vector<Found> after =
        project_plane(attributes, [](std::size_t) { return static_cast<float>(kResidual); });
    ASSERT_EQ(before.size(), after.size());
    std::size_t moved = 0;
    for (std::size_t k = 0; k < before.size(); ++k) {
      const double around = std::max(0.0, 1 - before[k].offset / static_cast<double>(kResidualOffset));
      EXPECT_NEAR(before[k].distance - after[k].distance, around * taken, 0.5);
      EXPECT_EQ(before[k].attribute, after[k].attribute);
      moved += around > 0.5 ? 1 : 0;
    }
    EXPECT_GT(moved, 100U);
  }
}

TEST(Residuals, OfStraysMoveNothing) {
  const std::vector<Found> before = project_plane(0, [](std::size_t) { return 0.0F; });
  const std::vector<Found> after =
      project_plane(0, [](std::size_t) { return static_cast<float>(kMostResidual * kRadius); });
  for (std::size_t k = 0; k < before.size(); ++k) EXPECT_NEAR(before[k].distance, after[k].distance, 0.5);
}

TEST(Residuals, OfNoiseMoveNothing) {
  const std::vector<Found> before = project_plane(0, [](std::size_t) { return 0.0F; });
  const std::vector<Found> after = project_plane(0, [](std::size_t i) { return i % 2 == 0 ? 300.0F : -300.0F; });
  double sum2 = 0;
  for (std::size_t k = 0; k < before.size(); ++k) sum2 += std::pow(before[k].distance - after[k].distance, 2);
  EXPECT_LT(std::sqrt(sum2 / static_cast<double>(before.size())), 60);
}

}  // namespace
}  // namespace lamina::test

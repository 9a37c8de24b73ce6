#include "clustering/resolve.h"

#include <gtest/gtest.h>

namespace lamina::clustering {
namespace {

/// A fan around vertex 0 at `centre` over the given ring.
std::vector<PatchTriangle> fan(const Eigen::Vector3d& centre, const std::vector<Eigen::Vector3d>& ring) {
  std::vector<PatchTriangle> out;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const std::size_t n = (i + 1) % ring.size();
    out.push_back({{centre, ring[i], ring[n]},
                   {0, static_cast<std::uint32_t>(i + 1), static_cast<std::uint32_t>(n + 1)},
                   {true, false, false}});
  }
  return out;
}

TEST(Patch, StaysOnAPlane) {
  const Eigen::Vector3d centre(3, 4, 7);
  const auto p = place_patch(fan(centre, {{5, 4, 7}, {3, 6, 7}, {1, 4, 7}, {3, 2, 7}}));
  EXPECT_NEAR((p - centre).norm(), 0, 1e-12);
}

TEST(Patch, FindsTheTip) {
  // One member on each of the planes x = 0, y = 0 and z = 0, in one triangle: the planes meet at the origin.
  std::vector<PatchTriangle> patch;
  for (int axis = 0; axis < 3; ++axis) {
    const auto on_plane = [axis](double u, double v) {
      Eigen::Vector3d p = Eigen::Vector3d::Zero();
      p[(axis + 1) % 3] = u;
      p[(axis + 2) % 3] = v;
      return p;
    };
    const auto first = static_cast<std::uint32_t>(3 * axis);
    patch.push_back(
        {{on_plane(1, 1), on_plane(4, -1), on_plane(-1, 4)}, {first, first + 1, first + 2}, {true, false, false}});
  }
  EXPECT_LT(place_patch(patch).norm(), 1e-9);
}

TEST(Patch, IsHeldNearItsMean) {
  // Nearly parallel planes meet far away; the answer must not go there.
  const Eigen::Vector3d centre(0, 0, 0);
  const auto p = place_patch(fan(centre, {{2, 0, 0.3}, {0, 2, 0.2}, {-2, 0, 0.3}, {0, -2, 0.4}}));
  EXPECT_LE(p.cwiseAbs().maxCoeff(), 1.0 + 1e-12);
}

TEST(Patch, WithoutAreaIsTheMean) {
  const Eigen::Vector3d centre(1, 2, 3);
  const auto p = place_patch(fan(centre, {centre, centre, centre}));
  EXPECT_NEAR((p - centre).norm(), 0, 1e-12);
}

}  // namespace
}  // namespace lamina::clustering

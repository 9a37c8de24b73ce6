// Sharp edges: found where samples show them, nowhere else, and the same bytes as ever.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "reconstruct/clouds.h"

namespace lamina {
namespace {

using test::Cloud;
using test::Point3;
using test::reconstruct;
using test::Reconstruction;

/// A cube of side 2, turned so that no edge follows the lattice.
struct TurnedCube {
  Eigen::Matrix3d turn =
      (Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitX()) * Eigen::AngleAxisd(0.8, Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()))
          .toRotationMatrix();

  [[nodiscard]] Eigen::Vector3d own(const Point3& p) const {
    return turn.transpose() * Eigen::Vector3d(p[0], p[1], p[2]);
  }
  [[nodiscard]] double distance(const Point3& p) const {
    const Eigen::Vector3d a = own(p).cwiseAbs();
    if ((a.array() <= 1).all()) return 1 - a.maxCoeff();
    return (a - a.cwiseMin(1)).norm();
  }
  [[nodiscard]] double edge_distance(const Point3& p) const {
    Eigen::Vector3d a = (own(p).cwiseAbs().array() - 1).abs();
    std::sort(a.data(), a.data() + 3);
    return std::hypot(a[0], a[1]);
  }
  /// `blur`: normals turn towards the edge's from so far on.
  [[nodiscard]] Cloud cloud(std::size_t count, double noise = 0, double blur = 0) const {
    std::mt19937 random(4);
    std::uniform_real_distribution<> u(-1, 1);
    Cloud cloud;
    for (std::size_t i = 0; i < count; ++i) {
      const auto axis = static_cast<Eigen::Index>(random() % 3);
      const double side = random() % 2 == 0 ? 1 : -1;
      Eigen::Vector3d p(u(random), u(random), u(random));
      p[axis] = side;
      Eigen::Vector3d n = Eigen::Vector3d::Zero();
      for (Eigen::Index k = 0; k < 3; ++k) {
        const double near = blur > 0 ? std::max(0.0, 1 - (1 - std::abs(p[k])) / blur) : 0;
        n[k] = k == axis ? side : std::copysign(near, p[k]);
      }
      p += noise * Eigen::Vector3d(u(random), u(random), u(random));
      const Eigen::Vector3d q = turn * p;
      const Eigen::Vector3d m = (turn * n).normalized();
      cloud.add({q.x(), q.y(), q.z()}, {m.x(), m.y(), m.z()});
    }
    return cloud;
  }
};

constexpr std::size_t kOnCube = 30000;
/// Between samples of the cube's 24 units of area.
const double kCubeSpacing = std::sqrt(24.0 / kOnCube);

SurfaceSettings with_features(bool features) {
  SurfaceSettings s;
  s.blend.reset();
  s.features = features;
  return s;
}

/// Root mean square distance of the mesh from the cube, of what lies within two spacings of an edge.
double error_near_edges(const TriangleMesh& mesh, const TurnedCube& cube) {
  double sum = 0;
  std::size_t n = 0;
  for (const auto& t : mesh.triangles) {
    Point3 centre{};
    for (const std::uint32_t v : t) {
      for (std::size_t k = 0; k < 3; ++k) centre[k] += mesh.positions[v][k] / 3;
    }
    if (cube.edge_distance(centre) > 2 * kCubeSpacing) continue;
    sum += std::pow(cube.distance(centre), 2);
    ++n;
  }
  return std::sqrt(sum / static_cast<double>(n));
}

TEST(Features, ACubesEdgesAreSharp) {
  const TurnedCube cube;
  const Cloud cloud = cube.cloud(kOnCube);
  const Reconstruction with = reconstruct(cloud, with_features(true));
  const Reconstruction without = reconstruct(cloud, with_features(false));
  EXPECT_TRUE(with.stats.plan.features);
  EXPECT_FALSE(with.stats.plan.sharpen) << "its normals are those of the faces";
  EXPECT_TRUE(with.facts.is_closed_manifold());
  EXPECT_LT(error_near_edges(with.mesh, cube), 0.33 * error_near_edges(without.mesh, cube));
  std::size_t on_edges = 0;
  for (const Point3& p : with.mesh.positions) {
    on_edges += cube.edge_distance(p) < 1e-3 * kCubeSpacing ? 1 : 0;
  }
  EXPECT_GT(static_cast<double>(on_edges), 0.6 * 24 / kCubeSpacing) << "vertices along its twelve edges";
}

TEST(Features, NormalsThatWereInterpolatedOverEdgesAreFoundAgain) {
  const TurnedCube cube;
  const Cloud cloud = cube.cloud(kOnCube, 0, 5 * kCubeSpacing);
  const Reconstruction with = reconstruct(cloud, with_features(true));
  const Reconstruction without = reconstruct(cloud, with_features(false));
  EXPECT_TRUE(with.stats.plan.sharpen);
  EXPECT_TRUE(with.facts.is_closed_manifold());
  EXPECT_LT(error_near_edges(with.mesh, cube), 0.23 * error_near_edges(without.mesh, cube));
}

TEST(Features, SmoothThingsHaveNone) {
  const Cloud sphere = test::sphere_cloud(20000);
  EXPECT_EQ(reconstruct(sphere, with_features(true)).mesh.positions,
            reconstruct(sphere, with_features(false)).mesh.positions);
  const Cloud torus = test::torus_cloud(20000);
  EXPECT_EQ(reconstruct(torus, with_features(true)).mesh.positions,
            reconstruct(torus, with_features(false)).mesh.positions);
}

TEST(Features, NoiseMakesNone) {
  Cloud noisy = test::sphere_cloud(20000);
  std::mt19937 random(8);
  std::normal_distribution<> noise(0, 0.01);
  std::normal_distribution<> turn(0, 0.2);
  for (Point3& p : noisy.positions) {
    for (double& c : p) c += noise(random);
  }
  for (Point3& n : noisy.normals) {
    for (double& c : n) c += turn(random);
  }
  const auto with = test::deviation(reconstruct(noisy, with_features(true)).mesh, test::distance_to_sphere);
  const auto without = test::deviation(reconstruct(noisy, with_features(false)).mesh, test::distance_to_sphere);
  EXPECT_LT(with.rms, 1.01 * without.rms);
  EXPECT_LT(with.largest, 1.1 * without.largest);
}

TEST(Features, ANoisyCubeIsNoWorse) {
  const TurnedCube cube;
  const Cloud cloud = cube.cloud(kOnCube, 0.2 * kCubeSpacing);
  const Reconstruction with = reconstruct(cloud, with_features(true));
  const Reconstruction without = reconstruct(cloud, with_features(false));
  EXPECT_LT(error_near_edges(with.mesh, cube), 1.02 * error_near_edges(without.mesh, cube));
  EXPECT_TRUE(with.facts.is_closed_manifold());
}

TEST(Features, SameBytesForThreadsAndWindows) {
  const test::TemporaryFolder folder;
  SurfaceSettings s = with_features(true);
  s.input = test::write_cloud(TurnedCube().cloud(12000, 0, 0.2), folder / "in.ply");
  s.output = folder / "out.ply";
  std::string first;
  for (const int threads : {1, 2, 5}) {
    for (const int window : {1, 3}) {
      RunContext run;
      run.threads = threads;
      s.window = window;
      reconstruct_surface(s, run);
      const std::string bytes = test::read_file(s.output);
      if (first.empty()) first = bytes;
      EXPECT_TRUE(first == bytes) << threads << " threads, window " << window;
    }
  }
}

}  // namespace
}  // namespace lamina

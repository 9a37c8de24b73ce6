#include "clustering/settled_normals.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include "boundary/grid_slabs.h"
#include "meshes/vec3.h"

namespace lamina {
namespace {

using meshes::Vec3;

constexpr int kCapRows = 24;  // of as many vertices, a slab each
constexpr double kCapRadius = 40;

std::vector<MeshSlab> settled(std::vector<MeshSlab> slabs) {
  return test::passed(NormalSettler(), std::move(slabs));
}

/// A piece of a sphere over the grid, the normals those of the sphere.
std::vector<MeshSlab> cap() {
  std::vector<MeshSlab> slabs = test::grid_slabs(kCapRows, [](int, int) { return 0.0F; });
  for (MeshSlab& slab : slabs) {
    VertexBatch& v = slab.vertices;
    for (std::size_t i = 0; i < v.size(); ++i) {
      const double x = v.x[i] - kCapRows / 2.0, y = v.y[i] - kCapRows / 2.0;
      v.z[i] = std::sqrt(kCapRadius * kCapRadius - x * x - y * y);
      v.nx[i] = static_cast<float>(x / kCapRadius);
      v.ny[i] = static_cast<float>(y / kCapRadius);
      v.nz[i] = static_cast<float>(v.z[i] / kCapRadius);
    }
  }
  return slabs;
}

Vec3 normal_of(const MeshSlab& slab, std::size_t i) {
  return {slab.vertices.nx[i], slab.vertices.ny[i], slab.vertices.nz[i]};
}

bool is_inside(std::size_t row, std::size_t i) {
  return row > 0 && i > 0 && row + 1 < kCapRows && i + 1 < kCapRows;
}

/// Turns every normal by about so much, in degrees.
void disturb(double degrees, std::vector<MeshSlab>& slabs) {
  std::mt19937 random(5);
  std::normal_distribution<double> turn(0, std::tan(degrees / 57.3));
  for (MeshSlab& slab : slabs) {
    for (std::size_t i = 0; i < slab.vertices.size(); ++i) {
      const Vec3 n = meshes::unit(
          {slab.vertices.nx[i] + turn(random), slab.vertices.ny[i] + turn(random), slab.vertices.nz[i] + turn(random)});
      slab.vertices.nx[i] = static_cast<float>(n[0]);
      slab.vertices.ny[i] = static_cast<float>(n[1]);
      slab.vertices.nz[i] = static_cast<float>(n[2]);
    }
  }
}

/// How far the normals inside are from the sphere's, mean and most, degrees.
std::pair<double, double> angles(const std::vector<MeshSlab>& slabs) {
  const std::vector<MeshSlab> truth = cap();
  double sum = 0, most = 0, n = 0;
  for (std::size_t row = 0; row < slabs.size(); ++row) {
    for (std::size_t i = 0; i < slabs[row].vertices.size(); ++i) {
      if (!is_inside(row, i)) continue;
      const double cosine = meshes::dot(normal_of(slabs[row], i), normal_of(truth[row], i));
      const double angle = 57.3 * std::acos(std::min(1.0, cosine));
      sum += angle;
      most = std::max(most, angle);
      ++n;
    }
  }
  return {sum / n, most};
}

TEST(NormalSettler, TrianglesPutNoisyNormalsRight) {
  std::vector<MeshSlab> slabs = cap();
  disturb(12, slabs);
  const auto before = angles(slabs);
  const auto after = angles(settled(slabs));
  EXPECT_GT(before.first, 12);
  EXPECT_GT(before.second, 35);
  EXPECT_LT(after.first, 5);
  EXPECT_LT(after.second, 15);
}

TEST(NormalSettler, AFlippedNormalIsOverruled) {
  std::vector<MeshSlab> slabs = cap();
  slabs[9].vertices.nx[9] *= -1;
  slabs[9].vertices.ny[9] *= -1;
  slabs[9].vertices.nz[9] *= -1;
  const MeshSlab after = settled(slabs)[9];
  EXPECT_GT(meshes::dot(normal_of(after, 9), normal_of(cap()[9], 9)), 0.99);
}

TEST(NormalSettler, GoodNormalsHardlyTurn) {
  const auto [mean, most] = angles(settled(cap()));
  EXPECT_LT(mean, 0.02);
  EXPECT_LT(most, 0.1);
}

TEST(NormalSettler, PlacesTrianglesAndTheFitsNormalsStay) {
  std::vector<MeshSlab> slabs = cap();
  disturb(12, slabs);
  const std::vector<MeshSlab> after = settled(slabs);
  ASSERT_EQ(after.size(), slabs.size());
  for (std::size_t row = 0; row < slabs.size(); ++row) {
    EXPECT_EQ(after[row].slab, slabs[row].slab);
    EXPECT_EQ(after[row].triangles, slabs[row].triangles);
    EXPECT_EQ(after[row].vertices.z, slabs[row].vertices.z);
    for (std::size_t i = 0; i < slabs[row].vertices.size(); ++i) {
      EXPECT_NE(normal_of(after[row], i), normal_of(slabs[row], i)) << row << ' ' << i;
      EXPECT_EQ(meshes::to_double(after[row].vertices.fitted_normal(i)), normal_of(slabs[row], i)) << row << ' ' << i;
    }
  }
}

TEST(NormalSettler, WhereTrianglesSayNothingTheFitStands) {
  std::vector<MeshSlab> slabs = cap();
  for (MeshSlab& slab : slabs) {
    slab.vertices.x.assign(slab.vertices.size(), 1.0);
    slab.vertices.y.assign(slab.vertices.size(), 1.0);
    slab.vertices.z.assign(slab.vertices.size(), 1.0);
  }
  EXPECT_LT(angles(settled(slabs)).second, 0.05);  // of floats
}

TEST(NormalSettler, DependsOnTheSlabsBesideAlone) {
  constexpr std::size_t kChanged = 8;
  std::vector<MeshSlab> slabs = cap();
  disturb(12, slabs);
  const std::vector<MeshSlab> one = settled(slabs);
  for (std::size_t i = 0; i < kCapRows; ++i) slabs[kChanged].vertices.z[i] += 0.3 * static_cast<double>(i);
  const std::vector<MeshSlab> other = settled(slabs);
  for (std::size_t s = 0; s < one.size(); ++s) {
    const bool near = s + kSettleReach >= kChanged && s <= kChanged + kSettleReach;
    EXPECT_EQ(near, one[s].vertices.nx != other[s].vertices.nx) << s;
  }
}

}  // namespace
}  // namespace lamina

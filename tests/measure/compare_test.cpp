#include "lamina/measure.h"

#include <gtest/gtest.h>

#include "meshes/mesh_files.h"

namespace lamina {
namespace {

using namespace testing_meshes;

CompareSettings samples(std::uint64_t n) {
  CompareSettings s;
  s.count = n;
  return s;
}

TEST(Compare, AMeshWithItselfIsAtNoDistance) {
  const TriangleMesh m = sphere(1, 30, 40);
  const CompareResult r = compare(m, m, samples(20000));
  EXPECT_LT(r.a_to_b->max, 1e-15);
  EXPECT_LT(r.b_to_a->max, 1e-15);
  EXPECT_EQ(r.a_to_b->samples, 20000u);
  EXPECT_NEAR(r.diagonal, std::sqrt(12.0), 0.02);
}

TEST(Compare, SpheresOfTwoRadiiAreTheDifferenceApart) {
  const CompareResult r = compare(sphere(1.1, 150, 300), sphere(1, 150, 300), samples(20000));
  for (const auto& s : {*r.a_to_b, *r.b_to_a}) {
    EXPECT_NEAR(s.rms, 0.1, 2e-4);
    EXPECT_NEAR(s.mean, 0.1, 2e-4);
    EXPECT_NEAR(s.p99, 0.1, 3e-4);
    EXPECT_NEAR(s.max, 0.1, 3e-4);
  }
}

TEST(Compare, SquareMovedAcrossItselfAndAside) {
  TriangleMesh up = grid(4), aside = grid(4);
  for (auto& p : up.positions) p[2] += 0.25;
  const CompareResult r = compare(up, grid(7), samples(10000));
  EXPECT_NEAR(r.a_to_b->rms, 0.25, 1e-12);
  EXPECT_NEAR(r.b_to_a->max, 0.25, 1e-12);
  // Moved by 0.5: half of it lies on the other, the rest at a distance uniform in [0, 0.5].
  for (auto& p : aside.positions) p[0] += 0.5;
  const CompareResult q = compare(aside, grid(7), samples(100000));
  EXPECT_NEAR(q.a_to_b->mean, 0.125, 5e-4);
  EXPECT_NEAR(q.a_to_b->rms, std::sqrt(1.0 / 24), 5e-4);
  EXPECT_NEAR(q.a_to_b->p99, 0.49, 2e-3);
  EXPECT_NEAR(q.a_to_b->max, 0.5, 1e-3);
}

TEST(Compare, VerticesAloneLieOnASurfaceThatTheirTrianglesCutInside) {
  // Every second meridian and parallel: the coarse sphere's vertices are the fine one's.
  const TriangleMesh coarse = sphere(1, 15, 22), fine = sphere(1, 30, 44);
  CompareSettings s = samples(20000);
  EXPECT_GT(compare(coarse, fine, s).a_to_b->rms, 2e-3);
  s.vertices = true;
  const CompareResult r = compare(coarse, fine, s);
  EXPECT_LT(r.a_to_b->max, 1e-12);
  EXPECT_GT(r.b_to_a->rms, 2e-3);
  EXPECT_LT(r.a_to_b->samples, r.b_to_a->samples);
}

TEST(Compare, BitsDoNotDependOnThreads) {
  RunContext one, four;
  one.threads = 1;
  four.threads = 4;
  const auto a = sphere(1, 15, 22), b = sphere(1.02, 31, 17);
  const CompareResult r = compare(a, b, samples(30000), one), s = compare(a, b, samples(30000), four);
  EXPECT_EQ(r.a_to_b->rms, s.a_to_b->rms);
  EXPECT_EQ(r.b_to_a->mean, s.b_to_a->mean);
  EXPECT_EQ(r.b_to_a->max, s.b_to_a->max);
}

TEST(Compare, CloudIsMeasuredOneWay) {
  TriangleMesh cloud;
  cloud.positions = {{0.5, 0.5, 2}, {0.25, 0.5, -1}};
  const CompareResult r = compare(cloud, grid(2), samples(10));
  EXPECT_EQ(r.a_to_b->samples, 2u);
  EXPECT_NEAR(r.a_to_b->mean, 1.5, 1e-12);
  EXPECT_EQ(r.a_to_b->max, 2);
  EXPECT_FALSE(r.b_to_a.has_value());
  EXPECT_FALSE(compare(grid(2), cloud, samples(10)).a_to_b.has_value());
  EXPECT_NEAR(compare(grid(2), cloud, samples(10)).b_to_a->mean, 1.5, 1e-12);
}

TEST(Compare, DegenerateTargetsCountAsSegmentsAndPoints) {
  TriangleMesh needle, cloud;
  needle.positions = {{0, 0, 0}, {1, 0, 0}, {0.5, 0, 0}, {5, 5, 5}};
  needle.triangles = {{0, 1, 2}, {3, 3, 3}};
  cloud.positions = {{0.3, 2, 0}, {5, 5, 6}, {-3, 4, 0}};
  const CompareResult r = compare(cloud, needle, samples(10));
  EXPECT_NEAR(r.a_to_b->mean, (2.0 + 1.0 + 5.0) / 3, 1e-12);
  expect_error(ExitCode::unreadable, [&] { compare(needle, grid(1), samples(10)); }, {"no area"});
}

TEST(Compare, NonsenseIsRefused) {
  expect_error(ExitCode::usage, [] { compare(grid(1), grid(1), samples(0)); }, {"--count"});
  expect_error(ExitCode::unreadable, [] { compare(TriangleMesh{}, TriangleMesh{}, samples(1)); }, {"neither side"});
}

}  // namespace
}  // namespace lamina

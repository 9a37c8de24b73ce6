#include "lamina/clip.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <numbers>

#include "lamina/error.h"
#include "lamina/measure.h"
#include "support/mesh_check.h"
#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina::tools {
namespace {

using namespace test;
using ::testing::HasSubstr;

class ClipTool : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  std::string cloud_ = write_points(folder_ / "cloud.ply", sphere_rows(2000), sphere_columns());
  std::string mesh_ = sphere_mesh(folder_ / "mesh.ply");
  std::string out_ = folder_ / "out.ply";
};

TEST_F(ClipTool, KeepsTheRowsThatBruteForceKeeps) {
  const SampleBatch all = read_points(cloud_);
  const auto texts = row_texts(all);
  const auto inside = [&](std::size_t i) {
    return all.x[i] >= -0.5 && all.x[i] <= 0.7 && all.y[i] >= -1 && all.y[i] <= 0.25 && all.z[i] >= -2 &&
           all.z[i] <= 0.9 && 0.5 * all.x[i] + (all.z[i] + 0.5) >= 0;
  };
  for (const std::string keep : {"inside", "outside"}) {
    std::vector<std::string> expected;
    for (std::size_t i = 0; i < texts.size(); ++i)
      if (inside(i) == (keep == "inside")) expected.push_back(texts[i]);
    const auto outcome = run_lamina({"clip", cloud_, "--box", "-0.5,-1,-2,0.7,0.25,0.9", "--plane", "0,0,-0.5,0.5,0,1",
                                     "--keep", keep, "-o", out_});
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(row_texts(read_points(out_)), expected) << keep;
    EXPECT_GT(expected.size(), 100U);
  }
}

TEST_F(ClipTool, StreamsThroughPipes) {
  ASSERT_EQ(run_lamina({"clip", cloud_, "--plane", "0,0,0,1,0,0", "-o", out_}).code, 0);
  const auto piped = run_shell("cat " + test::quoted(cloud_) + " | lamina clip - --plane 0,0,0,1,0,0 -o - --quiet");
  EXPECT_EQ(piped.code, 0) << piped.err;
  EXPECT_TRUE(piped.out == read_text(out_));
  const auto meshes = run_shell("cat " + test::quoted(mesh_) +
                                " | lamina clip - --plane 0,0,0,1,0,0 -o - --quiet | lamina check - --expect manifold");
  EXPECT_EQ(meshes.code, 0) << meshes.err;
}

TEST_F(ClipTool, AnswersMistakesWithTheirCodes) {
  EXPECT_EQ(run_lamina({"clip", cloud_, "-o", out_}).code, 2) << "no region";
  EXPECT_EQ(run_lamina({"clip", cloud_, "--box", "1,2,3", "-o", out_}).code, 2);
  EXPECT_EQ(run_lamina({"clip", cloud_, "--box", "1,0,0,0,1,1", "-o", out_}).code, 2) << "empty box";
  EXPECT_EQ(run_lamina({"clip", cloud_, "--plane", "0,0,0,0,0,0", "-o", out_}).code, 2) << "no normal";
  EXPECT_EQ(run_lamina({"clip", folder_ / "none.ply", "--plane", "0,0,0,0,0,1", "-o", out_}).code, 3);
  EXPECT_EQ(run_lamina({"clip", cloud_, "--plane", "0,0,0,0,0,1", "-o", folder_ / "no/such.ply"}).code, 4);
  const auto nothing = run_lamina({"clip", cloud_, "--plane", "0,0,5,0,0,1", "-o", out_});
  EXPECT_EQ(nothing.code, 5);
  EXPECT_THAT(nothing.err, HasSubstr("nothing of it lies inside"));
  EXPECT_EQ(run_lamina({"clip", mesh_, "--plane", "0,0,5,0,0,1", "-o", out_}).code, 5);
}

double area_of(const TriangleMesh& mesh) {
  return mesh.triangles.empty() ? 0 : measure_mesh(mesh).area;
}

RC_GTEST_PROP(ClipMesh, PartsAreManifoldAndMakeUpTheWhole, ()) {
  const auto coordinate = [] { return *rc::gen::inRange(-12, 13) * 0.1; };
  ClipRegion region;
  for (int i = *rc::gen::inRange(0, 3); i > 0; --i) {
    HalfSpace h{{coordinate(), coordinate(), coordinate()}, {coordinate(), coordinate(), coordinate()}};
    if (std::hypot(h.normal[0], h.normal[1], h.normal[2]) > 0) region.half_spaces.push_back(h);
  }
  if (region.half_spaces.empty() || *rc::gen::arbitrary<bool>()) {
    Box box;
    for (std::size_t k = 0; k < 3; ++k) {
      box.low[k] = coordinate();
      box.high[k] = box.low[k] + std::abs(coordinate());
    }
    region.box = box;
  }
  TriangleMesh mesh = sphere(1, 10);
  mesh.layout = {{"height", ScalarType::float32}};
  mesh.attributes.resize(1);
  for (const auto& p : mesh.positions) mesh.attributes[0].push_back(static_cast<float>(2 * p[2]));
  const TriangleMesh inside = clip_mesh(mesh, region, Keep::inside);
  const TriangleMesh outside = clip_mesh(mesh, region, Keep::outside);
  RC_ASSERT(std::abs(area_of(inside) + area_of(outside) - area_of(mesh)) < 1e-9);
  RC_ASSERT(check_mesh(inside.triangles).complex_edges == 0);
  RC_ASSERT(check_mesh(outside.triangles).complex_edges == 0);
  for (std::size_t v = 0; v < inside.positions.size(); ++v) {
    const auto& p = inside.positions[v];
    RC_ASSERT(std::abs(static_cast<double>(inside.attributes[0][v]) - 2 * p[2]) < 1e-6);
    if (region.box)
      for (std::size_t k = 0; k < 3; ++k) {
        RC_ASSERT(p[k] > region.box->low[k] - 1e-12);
        RC_ASSERT(p[k] < region.box->high[k] + 1e-12);
      }
    for (const HalfSpace& h : region.half_spaces) {
      double height = 0;
      for (std::size_t k = 0; k < 3; ++k) height += h.normal[k] * (p[k] - h.point[k]);
      RC_ASSERT(height > -1e-12);
    }
  }
}

TEST(ClipMesh, CutsTheSphereIntoCaps) {
  const TriangleMesh mesh = sphere(1, 60);
  for (const double z : {-0.6, 0.0, 0.3}) {
    const TriangleMesh cap = clip_mesh(mesh, {std::nullopt, {{{0, 0, z}, {0, 0, 2}}}}, Keep::inside);
    EXPECT_NEAR(area_of(cap), 2 * std::numbers::pi * (1 - z), 0.02) << z;
    const MeshFacts facts = check_mesh(cap.triangles);
    EXPECT_TRUE(facts.is_manifold());
    EXPECT_FALSE(facts.boundary.empty());
  }
}

TEST(ClipMesh, LeavesAMeshThatLiesInsideAsItIs) {
  const TriangleMesh mesh = sphere(1, 8);
  const TriangleMesh same = clip_mesh(mesh, {Box{{-1, -1, -1}, {1, 1, 1}}, {}}, Keep::inside);
  EXPECT_EQ(same.positions, mesh.positions);
  EXPECT_EQ(same.triangles, mesh.triangles);
  EXPECT_TRUE(clip_mesh(mesh, {Box{{-1, -1, -1}, {1, 1, 1}}, {}}, Keep::outside).triangles.empty());
}

}  // namespace
}  // namespace lamina::tools

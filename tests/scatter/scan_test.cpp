#include "lamina/scatter.h"

#include <gtest/gtest.h>

#include <cmath>

#include "lamina/measure.h"
#include "meshes/mesh_files.h"
#include "meshes/vec3.h"
#include "support/paths.h"

namespace lamina {
namespace {

using namespace testing_meshes;
using namespace meshes;

TEST(Scan, SeesASphereFromAllSidesAsNoisyAsAsked) {
  const ScratchFolder folder;
  ScanSettings settings;
  settings.views = 6;
  settings.count = 20000;
  settings.noise = 0.5;
  const ScanReport report = scan(sphere(1, 100, 200), settings, folder.file("s.ply"));
  EXPECT_NEAR(static_cast<double>(report.samples), 20000, 600);
  // Each view sees the cap where the cosine is at least 0.2.
  const double seen = std::acos(-1.0) * (1 - 0.04) * settings.views;
  EXPECT_NEAR(report.spacing, std::sqrt(seen / 20000), 0.02 * report.spacing);
  const TriangleMesh cloud = read_mesh(folder.file("s.ply"));
  ASSERT_EQ(cloud.positions.size(), report.samples);
  ASSERT_EQ(cloud.layout.size(), 1u);
  EXPECT_EQ(cloud.layout[0], (AttributeSpec{"confidence", ScalarType::float32}));
  double squares = 0;
  int above = 0;
  for (std::size_t i = 0; i < cloud.positions.size(); ++i) {
    const double confidence = cloud.attributes[0][i];
    EXPECT_GE(confidence, 0.2);
    EXPECT_LE(confidence, 1.0001);
    EXPECT_GT(dot(to_double(cloud.normals[i]), unit(cloud.positions[i])), 0.95);
    // Error across the surface is the range error times the cosine, to first order.
    if (confidence > 0.7) {
      const double along = (norm(cloud.positions[i]) - 1) / confidence / report.spacing;
      squares += along * along;
      ++above;
    }
  }
  EXPECT_NEAR(std::sqrt(squares / above), 0.5, 0.03);
}

TEST(Scan, InsideFacesAndHiddenOnesAreNotSeen) {
  const ScratchFolder folder;
  TriangleMesh m = sphere(1, 50, 80);
  const auto first = static_cast<std::uint32_t>(m.positions.size());
  for (const auto& p : sphere(0.5, 50, 80).positions) m.positions.push_back(p);
  for (const auto& t : sphere(0.5, 50, 80).triangles) m.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  ScanSettings settings;
  settings.views = 3;
  settings.count = 5000;
  scan(m, settings, folder.file("h.ply"));
  for (const auto& p : read_mesh(folder.file("h.ply")).positions) EXPECT_GT(norm(p), 0.9);
  for (auto& t : m.triangles) std::swap(t[0], t[1]);
  expect_error(ExitCode::empty, [&] { scan(m, settings, folder.file("i.ply")); }, {"inside out"});
}

TEST(Scan, NonsenseIsRefused) {
  const ScratchFolder folder;
  const auto refuse = [&](auto change, const char* word) {
    ScanSettings s;
    change(s);
    expect_error(ExitCode::usage, [&] { scan(tetrahedron(), s, folder.file("x.ply")); }, {word});
  };
  refuse([](auto& s) { s.views = 0; }, "views");
  refuse([](auto& s) { s.count = 0; }, "--count");
  refuse([](auto& s) { s.noise = -1; }, "noise");
  refuse([](auto& s) { s.least_facing = 1; }, "facing");
  expect_error(ExitCode::unreadable, [&] { scan(TriangleMesh{}, {}, folder.file("x.ply")); }, {"no triangles"});
}

TEST(Amphora, IsManifoldWithAnOpenRim) {
  const CheckReport r = check_mesh(amphora_mesh());
  EXPECT_TRUE(r.manifold());
  EXPECT_EQ(r.components, 3u) << "body and two handles";
  EXPECT_EQ(r.boundary_loops, 5u) << "the rim and both ends of each handle";
  EXPECT_EQ(r.largest_component_boundary_edges, 720u);
  EXPECT_EQ(r.zero_area_triangles, 0u);
}

TEST(Amphora, CommittedScanIsMadeAgainByteForByte) {
  const ScratchFolder folder;
  ScanSettings settings;
  settings.views = 14;
  settings.count = 200000;
  const TriangleMesh truth = amphora_mesh();
  RunContext run;
  run.threads = 3;
  scan(truth, settings, folder.file("a.ply"), run);
  const std::string committed = std::string(LAMINA_SOURCE_DIR) + "/data/amphora_scan.ply";
  EXPECT_TRUE(bytes_of(folder.file("a.ply")) == bytes_of(committed));
  CompareSettings few;
  few.count = 1;  // of the truth: only the cloud's distance is asked for
  const CompareResult r = compare(read_mesh(committed), truth, few);
  EXPECT_LT(r.a_to_b->rms, 0.15 * 0.0083);
}

}  // namespace
}  // namespace lamina

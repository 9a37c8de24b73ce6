// lamina simplify: what it writes, what it refuses, and that it does not hold what it reads.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "lamina/measure.h"
#include "lamina/mesh.h"
#include "lamina/mesh_receiver.h"
#include "support/heap.h"
#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina::tools {
namespace {

using namespace test;
using ::testing::HasSubstr;

/// 2 n^2 triangles of a wave, as `lamina surface` writes meshes.
void write_wave(const std::string& path, std::uint32_t n) {
  TriangleMesh mesh;
  for (std::uint32_t i = 0; i <= n; ++i)
    for (std::uint32_t j = 0; j <= n; ++j) {
      const double x = static_cast<double>(i) / n, y = static_cast<double>(j) / n;
      mesh.positions.push_back({x, y, 0.05 * std::sin(9 * x) * std::cos(7 * y)});
      for (double& c : mesh.positions.back()) c = static_cast<double>(static_cast<float>(c));
      mesh.normals.push_back({0, 0, 1});
    }
  for (std::uint32_t i = 0; i < n; ++i)
    for (std::uint32_t j = 0; j < n; ++j) {
      const std::uint32_t a = i * (n + 1) + j, b = a + n + 1;
      mesh.triangles.push_back({a, b, b + 1});
      mesh.triangles.push_back({a, b + 1, a + 1});
    }
  write_mesh(mesh, StreamedMeshLayout{}, path);
}

TEST(SimplifyTool, WritesSeveralFormatsOfOneMesh) {
  const TemporaryFolder folder;
  write_wave(folder / "wave.ply", 60);
  const auto outcome = run_lamina({"simplify", folder / "wave.ply", "--ratio", "0.25", "-o", folder / "few.ply", "-o",
                                   folder / "few.glb", "-o", folder / "few.obj"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const TriangleMesh ply = read_mesh(folder / "few.ply"), obj = read_mesh(folder / "few.obj");
  EXPECT_EQ(ply.triangles.size(), 1800U);
  EXPECT_EQ(ply.triangles, obj.triangles);
  EXPECT_EQ(read_mesh(folder / "few.glb").triangles.size(), 1800U);
  EXPECT_TRUE(check_mesh(ply).manifold());
}

TEST(SimplifyTool, RefusesWithoutLeavingAnything) {
  const TemporaryFolder folder;
  write_wave(folder / "wave.ply", 10);
  const long entries = folder.entries();
  const auto refuses = [&](const std::vector<std::string>& goal, const char* why) {
    std::vector<std::string> words{"simplify", folder / "wave.ply", "-o", folder / "few.ply"};
    words.insert(words.end(), goal.begin(), goal.end());
    const auto outcome = run_lamina(words);
    EXPECT_EQ(outcome.code, 2) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(why));
    EXPECT_EQ(folder.entries(), entries);
  };
  refuses({}, "one of --error, --triangles and --ratio");
  refuses({"--error", "0"}, "above 0");
  refuses({"--error", "nan"}, "above 0");
  refuses({"--triangles", "0"}, "at least one triangle");
  refuses({"--triangles", "-5"}, "-5: is below 0");
  refuses({"--triangles", "201"}, "201 triangles are wanted, the mesh has 200");
  refuses({"--ratio", "1.1"}, "up to 1");
  refuses({"--ratio", "0.5", "--error", "1"}, "excludes");
}

TEST(SimplifyTool, HoldsNoMoreThanARegion) {
  if (!test::heap_is_counted()) GTEST_SKIP() << "a sanitizer's shadow memory does not fit under a limit";
  const TemporaryFolder folder;
  write_wave(folder / "wave.ply", 900);  // 1.62 M triangles: held, they would take more
  const auto outcome = run_shell("ulimit -v 650000 && cd " + quoted(folder.path()) +
                                 " && lamina simplify wave.ply --ratio 0.2 -o few.ply --threads 1 -q");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const TriangleMesh few = read_mesh(folder / "few.ply");
  EXPECT_LE(few.triangles.size(), 324'000U);
  EXPECT_GE(few.triangles.size(), 323'000U);
  EXPECT_TRUE(check_mesh(few).manifold());
}

}  // namespace
}  // namespace lamina::tools

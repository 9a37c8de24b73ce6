#include <gtest/gtest.h>

#include "lamina/mesh.h"
#include "meshes/mesh_files.h"

namespace lamina {
namespace {

using namespace testing_meshes;

TriangleMesh coloured() {
  TriangleMesh m = tetrahedron();
  m.positions[1] = {4100000.456, -1e-30, 0.1};
  m.normals.assign(4, {0, 0.6F, 0.8F});
  m.layout = {{"red", ScalarType::uint8}, {"green", ScalarType::uint8}, {"blue", ScalarType::uint8}};
  m.attributes = {{0, 10, 20, 255}, {1, 2, 3, 4}, {0, 0, 0, 128}};
  return m;
}

TEST(WriteMesh, ReadsBackAsItWas) {
  const ScratchFolder folder;
  const TriangleMesh m = coloured();
  for (const char* format : {"ply", "obj", "off"}) {
    const auto path = folder.file(std::string("m.") + format);
    write_mesh(m, path);
    const TriangleMesh back = read_mesh(path);
    EXPECT_EQ(back.positions, m.positions) << format;
    EXPECT_EQ(back.normals, m.normals) << format;
    EXPECT_EQ(back.triangles, m.triangles) << format;
    ASSERT_GE(back.layout.size(), 3u) << format;
    const float scale = back.layout[0].type == ScalarType::float32 ? 255.0F : 1.0F;
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t v = 0; v < 4; ++v)
        EXPECT_NEAR(back.attributes[k][v] * scale, m.attributes[k][v], 0.05) << format;
  }
}

TEST(WriteMesh, PlyPositionsAreFloatsWhereNothingIsLost) {
  const ScratchFolder folder;
  write_mesh(tetrahedron(), folder.file("f.ply"));
  EXPECT_NE(bytes_of(folder.file("f.ply")).find("property float x"), std::string::npos);
  write_mesh(coloured(), folder.file("d.ply"));
  EXPECT_NE(bytes_of(folder.file("d.ply")).find("property double x"), std::string::npos);
}

TEST(WriteMesh, StlKeepsShapeAsFloats) {
  const ScratchFolder folder;
  write_mesh(tetrahedron(), folder.file("t.stl"));
  const TriangleMesh back = read_mesh(folder.file("t.stl"));
  EXPECT_EQ(back.positions.size(), 4u);
  EXPECT_EQ(back.triangles.size(), 4u);
}

TEST(WriteMesh, FailuresAreNamedAndLeaveNothing) {
  const ScratchFolder folder;
  expect_error(ExitCode::usage, [&] { write_mesh(tetrahedron(), folder.file("m.xyz")); }, {"m.xyz", ".ply"});
  expect_error(ExitCode::budget, [&] { write_mesh(tetrahedron(), folder.file("none/m.ply")); },
               {"m.ply", "does not exist"});
  std::filesystem::create_directory(folder.file("d.ply"));
  expect_error(ExitCode::budget, [&] { write_mesh(tetrahedron(), folder.file("d.ply")); }, {"d.ply", "directory"});
  EXPECT_EQ(folder.entries(), 1u);
}

}  // namespace
}  // namespace lamina

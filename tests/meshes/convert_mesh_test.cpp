#include "lamina/mesh.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <string>

#include "meshes/mesh_files.h"
#include "tiles/tile_files.h"

namespace lamina {
namespace {

using namespace testing_meshes;

TEST(ConvertMeshFile, PieceByPieceIsAsFromMemory) {
  const ScratchFolder folder;
  for (const bool map : {false, true}) {
    TriangleMesh mesh = testing_tiles::bumpy_ball(60, true, {map ? 412345.678 : 0, 0, 0});
    mesh.layout.push_back({"height", ScalarType::float32});
    mesh.attributes.emplace_back();
    for (const auto& p : mesh.positions) mesh.attributes.back().push_back(static_cast<float>(p[2]));
    write_mesh(mesh, folder.file("m.ply"));
    const TriangleMesh whole = read_mesh(folder.file("m.ply"));
    for (const char* ending : {"glb", "obj", "off", "stl"}) {
      const std::string pieces = folder.file(std::string("pieces.") + ending),
                        held = folder.file(std::string("held.") + ending);
      const auto converted = convert_mesh_file(folder.file("m.ply"), pieces);
      ASSERT_TRUE(converted) << ending;
      EXPECT_EQ(converted->triangles, mesh.triangles.size());
      write_mesh(whole, held);
      EXPECT_TRUE(bytes_of(pieces) == bytes_of(held)) << ending;
    }
  }
}

TEST(ConvertMeshFile, LeavesOthersToBeReadWhole) {
  const ScratchFolder folder;
  TriangleMesh mesh = testing_tiles::bumpy_ball(10, true);
  write_mesh(mesh, folder.file("m.ply"));
  write_mesh(mesh, folder.file("m.obj"));
  EXPECT_FALSE(convert_mesh_file(folder.file("m.ply"), folder.file("n.ply")));
  EXPECT_FALSE(convert_mesh_file(folder.file("m.obj"), folder.file("n.glb")));
  std::string bytes = bytes_of(folder.file("m.ply"));
  bytes.back() = '\x7F';  // a vertex that is not there
  folder.write("bad.ply", bytes);
  EXPECT_FALSE(convert_mesh_file(folder.file("bad.ply"), folder.file("n.glb")));
  mesh.positions[5][1] = std::numeric_limits<double>::infinity();
  write_mesh(mesh, folder.file("far.ply"));
  EXPECT_FALSE(convert_mesh_file(folder.file("far.ply"), folder.file("n.glb")));
  EXPECT_FALSE(std::filesystem::exists(folder.file("n.glb")));
  EXPECT_FALSE(std::filesystem::exists(folder.file("n.ply")));
}

}  // namespace
}  // namespace lamina

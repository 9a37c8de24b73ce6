#include <gtest/gtest.h>

#include "base/temporary_folder.h"
#include "lamina/error.h"
#include "meshes/mesh_sink.h"

namespace lamina {
namespace {

TEST(Signature, OwnFilesAreKnown) {
  const test::TemporaryFolder folder;
  MeshSink({.path = folder / "mesh.ply", .comments = {"made by lamina 99"}}).commit();
  const auto version = read_sink_signature(folder / "mesh.ply");
  ASSERT_TRUE(version.has_value());
  EXPECT_EQ("made by lamina " + *version, sink_signature());
}

TEST(Signature, OthersAreNot) {
  const test::TemporaryFolder folder;
  for (const char* text : {"", "ply", "ply\nformat ascii 1.0\ncomment made by hand\n", "x\ncomment made by lamina 1\n",
                           "ply\ncomment made by lamina 1"}) {
    EXPECT_EQ(read_sink_signature(test::write_file(folder / "a.ply", text)), std::nullopt) << text;
  }
  EXPECT_THROW(read_sink_signature(folder / "none.ply"), Error);
  EXPECT_THROW(read_sink_signature(folder.path()), Error);
}

}  // namespace
}  // namespace lamina

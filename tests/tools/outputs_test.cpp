#include "common/outputs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lamina/error.h"

namespace lamina::tools {
namespace {

using ::testing::HasSubstr;

template <class Require>
std::string refusal(const Require& require, const std::string& name) {
  try {
    require(name);
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ExitCode::usage);
    return e.what();
  }
  return {};
}

TEST(OutputName, MayPromiseWhatIsWrittenOrNothing) {
  for (const char* name : {"", "-", "out", "mesh.tmp", "scan_1.5", "/dev/null", ".ply", "a.b/out"}) {
    EXPECT_EQ(refusal(require_mesh_name, name), "") << name;
    EXPECT_EQ(refusal(require_volume_name, name), "") << name;
    EXPECT_EQ(refusal(require_picture_name, name), "") << name;
  }
  for (const char* name : {"a.obj.PLY", "a.OBJ", "a.off", "a.stl", "a.glb"})
    EXPECT_EQ(refusal(require_mesh_name, name), "");
  EXPECT_EQ(refusal(require_volume_name, "a.ply.vdb"), "");
  EXPECT_EQ(refusal(require_picture_name, "a.Png"), "");
}

TEST(OutputName, ThatPromisesAnotherFormatIsRefusedWithTheWayToIt) {
  EXPECT_THAT(refusal(require_mesh_name, "a.ply.gz"), HasSubstr("-o - | gzip"));
  EXPECT_THAT(refusal(require_mesh_name, "a.vdb"), HasSubstr("--vdb"));
  EXPECT_THAT(refusal(require_mesh_name, "a.usdc"),
              HasSubstr("a.usdc: the mesh is written as PLY, OBJ, OFF, STL or GLB; name it .ply"));
  EXPECT_THAT(refusal(require_volume_name, "a.ply"),
              HasSubstr("a.ply: the volume is written as OpenVDB; name it .vdb"));
  EXPECT_THAT(refusal(require_picture_name, "a.jpg"), HasSubstr("a.jpg: the picture is written as PNG; name it .png"));
}

}  // namespace
}  // namespace lamina::tools

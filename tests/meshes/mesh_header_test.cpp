#include "meshes/mesh_header.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "lamina/error.h"
#include "points/ply_header.h"

namespace lamina {
namespace {

using testing::HasSubstr;

TEST(MeshHeader, LengthIsTheSameForAllCounts) {
  const MeshSinkSettings settings{.attributes = {{"red", ScalarType::uint16}}, .comments = {"blend 1"}};
  const std::size_t bytes = mesh_header_bytes(settings);
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint64_t>::max();
  for (const std::uint64_t n : {std::uint64_t{0}, std::uint64_t{9}, std::uint64_t{10}, std::uint64_t{3} << 30, kMost}) {
    const std::string text = mesh_header(settings, n, kMost - n);
    EXPECT_EQ(text.size(), bytes);
    const PlyHeader header = parse_ply_header(text, "header");
    EXPECT_EQ(header.bytes, bytes);
    EXPECT_EQ(header.elements.at(0).count, n);
    EXPECT_EQ(header.elements.at(1).count, kMost - n);
  }
}

TEST(MeshHeader, HoldsWhatItShould) {
  const std::string text = mesh_header({.attributes = {{"red", ScalarType::uint8}, {"t", ScalarType::float64}},
                                        .double_positions = true,
                                        .comments = {"two\nlines"}},
                                       5, 6);
  EXPECT_THAT(text, testing::StartsWith("ply\nformat binary_little_endian 1.0\ncomment made by lamina "));
  EXPECT_THAT(
      text, HasSubstr("\ncomment two lines\nelement vertex 5\nproperty double x\nproperty double y\nproperty double z\n"
                      "property float nx\nproperty float ny\nproperty float nz\nproperty uchar red\nproperty double t\n"
                      "element face 6\nproperty list uchar int vertex_indices\ncomment ---"));
  EXPECT_THAT(text, testing::EndsWith("-\nend_header\n"));
}

TEST(MeshHeader, ManyVerticesNeedUnsignedIndices) {
  const std::uint64_t most = std::numeric_limits<std::int32_t>::max();
  EXPECT_THAT(mesh_header({}, most, 1), HasSubstr("list uchar int "));
  EXPECT_THAT(mesh_header({}, most + 1, 1), HasSubstr("list uchar uint "));
}

TEST(MeshHeader, NamesAPlyCannotHoldAreRefused) {
  require_ply_names({{"red", ScalarType::uint8}, {"n", ScalarType::uint8}});
  for (const char* name : {"", "a b", "a\n", "nx", "z"})
    EXPECT_THROW(require_ply_names({{name, ScalarType::uint8}}), Error);
  EXPECT_THROW(require_ply_names({{"a", ScalarType::uint8}, {"a", ScalarType::float32}}), Error);
}

}  // namespace
}  // namespace lamina

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "base/temporary_folder.h"
#include "lamina/error.h"
#include "meshes/mesh_sink.h"
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

VertexBatch batch_of(std::size_t n, std::size_t attributes) {
  VertexBatch batch;
  for (auto* axis : {&batch.x, &batch.y, &batch.z}) axis->assign(n, 1.5);
  for (auto* normal : {&batch.nx, &batch.ny, &batch.nz}) normal->assign(n, 0.5F);
  batch.attributes.assign(attributes, std::vector<float>(n, 2.0F));
  return batch;
}

template <class T>
std::vector<T> written(ScalarType type, const std::vector<float>& values) {
  VertexBatch batch = batch_of(values.size(), 1);
  batch.attributes[0] = values;
  const AttributeLayout layout{{"a", type}};
  const std::size_t stride = vertex_record_bytes(layout, false);
  EXPECT_EQ(stride, 24 + sizeof(T));
  std::vector<std::byte> bytes(values.size() * stride);
  encode_vertices(batch, layout, false, 0, values.size(), bytes.data());
  std::vector<T> result(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) std::memcpy(&result[i], bytes.data() + i * stride + 24, sizeof(T));
  return result;
}

TEST(Records, IntegersAreRoundedAndClamped) {
  const std::vector<float> values{-1e30F, -1.0F, -0.4F, 0.49999997F, 0.6F, 1.5F, 254.6F, 255.4F, 300.0F, 1e30F};
  EXPECT_EQ(written<std::uint8_t>(ScalarType::uint8, values),
            (std::vector<std::uint8_t>{0, 0, 0, 0, 1, 2, 255, 255, 255, 255}));
  EXPECT_EQ(written<std::int8_t>(ScalarType::int8, values),
            (std::vector<std::int8_t>{-128, -1, 0, 0, 1, 2, 127, 127, 127, 127}));
  EXPECT_EQ(written<std::uint16_t>(ScalarType::uint16, values),
            (std::vector<std::uint16_t>{0, 0, 0, 0, 1, 2, 255, 255, 300, 65535}));
  EXPECT_EQ(written<std::int16_t>(ScalarType::int16, values),
            (std::vector<std::int16_t>{-32768, -1, 0, 0, 1, 2, 255, 255, 300, 32767}));
  EXPECT_EQ(written<std::uint32_t>(ScalarType::uint32, values),
            (std::vector<std::uint32_t>{0, 0, 0, 0, 1, 2, 255, 255, 300, 4294967295U}));
  EXPECT_EQ(written<std::int32_t>(ScalarType::int32, values),
            (std::vector<std::int32_t>{-2147483647 - 1, -1, 0, 0, 1, 2, 255, 255, 300, 2147483647}));
  EXPECT_EQ(written<float>(ScalarType::float32, values), values);
  EXPECT_EQ(written<double>(ScalarType::float64, values), std::vector<double>(values.begin(), values.end()));
}

std::string refusal(const VertexBatch& batch, bool double_positions) {
  try {
    require_writable(batch, {{"red", ScalarType::uint8}}, double_positions, 100);
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ExitCode::internal);
    return e.what();
  }
  return "nothing";
}

TEST(Records, NumbersThatAreNoneAreRefusedByVertexAndName) {
  using testing::HasSubstr;
  const float nan = std::nanf("");
  const float inf = std::numeric_limits<float>::infinity();
  VertexBatch batch = batch_of(50, 1);
  EXPECT_EQ(refusal(batch, false), "nothing");
  batch.y[7] = 1e39;
  EXPECT_THAT(refusal(batch, false), HasSubstr("vertex 107 of the mesh would get y = 1e+39"));
  EXPECT_EQ(refusal(batch, true), "nothing");
  batch.y[7] = -HUGE_VAL;
  EXPECT_THAT(refusal(batch, true), HasSubstr("vertex 107 of the mesh would get y = -inf"));
  batch = batch_of(50, 1);
  batch.nz[49] = nan;
  EXPECT_THAT(refusal(batch, false), HasSubstr("vertex 149 of the mesh would get nz = nan"));
  batch = batch_of(50, 1);
  batch.attributes[0][0] = inf;
  EXPECT_THAT(refusal(batch, false), HasSubstr("vertex 100 of the mesh would get red = inf"));
  batch = batch_of(50, 1);
  batch.nx.pop_back();
  EXPECT_THAT(refusal(batch, false), HasSubstr("differ in length"));
  EXPECT_THAT(refusal(batch_of(50, 2), false), HasSubstr("differ in length"));
}

TEST(Records, FacesAndTheirLargestIndex) {
  const std::array<std::uint32_t, 3> faces[] = {{1, 2, 3}, {0x01020304, 5, 6}};
  std::byte bytes[2 * kFaceRecordBytes];
  EXPECT_EQ(encode_faces(faces, 2, bytes), 0x01020304U);
  const unsigned char expected[] = {3, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, 3, 4, 3, 2, 1, 5, 0, 0, 0, 6, 0, 0, 0};
  EXPECT_EQ(std::memcmp(bytes, expected, sizeof expected), 0);
}

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

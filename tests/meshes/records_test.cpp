#include "meshes/records.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "lamina/error.h"

namespace lamina {
namespace {

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

}  // namespace
}  // namespace lamina

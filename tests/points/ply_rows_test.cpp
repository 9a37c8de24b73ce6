#include "points/ply_rows.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lamina/error.h"

namespace lamina {
namespace {

using testing::HasSubstr;

PlyHeader header_with(const std::string& vertex_properties) {
  return parse_ply_header(
      "ply\nformat binary_little_endian 1.0\nelement camera 1\nproperty float x\nelement vertex 5\n" +
          vertex_properties + "end_header\n",
      "a.ply");
}

const std::string kXyz = "property double x\nproperty double y\nproperty double z\n";

std::string refused_rows(const PlyHeader& header) {
  try {
    understand_vertices(header, "a.ply", "a.ply");
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ExitCode::unreadable);
    EXPECT_THAT(e.what(), HasSubstr("a.ply: "));
    return e.what();
  }
  return "nothing";
}

TEST(PlyRows, PropertiesGetTheirRoles) {
  const PlyRows rows = understand_vertices(
      header_with("property uchar red\nproperty float confidence\n" + kXyz +
                  "property float quality\nproperty float pscale\n"
                  "property float nx\nproperty float ny\nproperty float nz\nproperty float radius\n"),
      "-", "standard input");
  EXPECT_EQ(rows.element, 1);
  EXPECT_EQ(rows.info.path, "-");
  EXPECT_EQ(rows.info.count, 5);
  EXPECT_TRUE(rows.info.has_normals && rows.info.has_radius && rows.info.has_quality && rows.info.double_precision);
  EXPECT_EQ(rows.info.attributes,
            (AttributeLayout{
                {"red", ScalarType::uint8}, {"confidence", ScalarType::float32}, {"pscale", ScalarType::float32}}));
  EXPECT_EQ(rows.stride, 1 + 4 + 24 + 8 + 12 + 4);
  EXPECT_EQ(rows.columns[3].role, Role::y);
  EXPECT_EQ(rows.columns[3].offset, 1 + 4 + 8);
  EXPECT_EQ(rows.columns[5].role, Role::quality);
  EXPECT_EQ(rows.columns[6].attribute, 2);
}

TEST(PlyRows, AlternativeNamesServeWhenAlone) {
  const PlyRows rows =
      understand_vertices(header_with(kXyz + "property float pscale\nproperty float confidence\n"), "a", "a");
  EXPECT_TRUE(rows.info.has_radius && rows.info.has_quality);
  EXPECT_FALSE(rows.info.has_normals);
  EXPECT_TRUE(rows.info.attributes.empty());
}

TEST(PlyRows, OtherProgramsNamesOfTriplesAreUnderstood) {
  const PlyRows rows = understand_vertices(
      header_with(
          "property float X\nproperty float Y\nproperty float Z\nproperty float NormalX\nproperty float normaly\n"
          "property float normal_z\nproperty uchar diffuse_red\nproperty uchar diffuse_green\n"
          "property uchar diffuse_blue\nproperty float I\n"),
      "a", "a");
  EXPECT_TRUE(rows.info.has_normals);
  EXPECT_EQ(rows.columns[2].role, Role::z);
  EXPECT_EQ(rows.columns[4].role, Role::ny);
  EXPECT_EQ(rows.info.attributes, (AttributeLayout{{"red", ScalarType::uint8},
                                                   {"green", ScalarType::uint8},
                                                   {"blue", ScalarType::uint8},
                                                   {"I", ScalarType::float32}}));
  // Not where the usual names are there as well, and not one or two of three.
  const PlyRows both = understand_vertices(
      header_with(kXyz + "property float nx\nproperty float ny\nproperty float nz\nproperty float normal_x\n"
                         "property float normal_y\nproperty float normal_z\nproperty uchar r\nproperty uchar g\n"),
      "a", "a");
  EXPECT_TRUE(both.info.has_normals);
  EXPECT_EQ(both.info.attributes[0].name, "normal_x");
  EXPECT_EQ(both.info.attributes[3].name, "r");
}

TEST(PlyRows, RefusesWhatMakesNoPoints) {
  EXPECT_THAT(refused_rows(header_with("property float x\nproperty float y\n")),
              HasSubstr("no property 'z'; points need x y z"));
  EXPECT_THAT(refused_rows(header_with(kXyz + "property float nx\nproperty float nz\n")),
              HasSubstr("normals are incomplete"));
  EXPECT_THAT(refused_rows(header_with(kXyz + "property list uchar int ids\n")),
              HasSubstr("property 'ids' of the vertices is a list"));
  EXPECT_THAT(refused_rows(header_with(kXyz + "property float y\n")),
              HasSubstr("property 'y' of the points is there twice"));
  const auto without = parse_ply_header("ply\nformat ascii 1.0\nelement face 1\nelement edge 0\nend_header\n", "a.ply");
  EXPECT_THAT(refused_rows(without), HasSubstr("no element 'vertex'; its elements are: 'face', 'edge'"));
}

TEST(PlyRows, BatchKeepsOnlyWhatTheSourceHas) {
  const PlyRows rows = understand_vertices(header_with(kXyz + "property uchar red\n"), "a", "a");
  SampleBatch batch;
  batch.nx.resize(9);
  batch.radius.resize(9);
  batch.attributes.resize(4);
  const auto targets = prepare_batch(rows.info, rows.columns, 3, 2, batch);
  EXPECT_EQ(batch.first, 3);
  EXPECT_EQ(batch.size(), 2);
  EXPECT_TRUE(batch.nx.empty() && batch.radius.empty());
  ASSERT_EQ(batch.attributes.size(), 1);
  EXPECT_EQ(targets[1].wide, batch.y.data());
  EXPECT_EQ(targets[3].narrow, batch.attributes[0].data());
}

}  // namespace
}  // namespace lamina

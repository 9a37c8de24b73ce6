// Elements of a PLY as points, and counts of binary files against what the files hold.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/temporary_folder.h"
#include "lamina/error.h"
#include "lamina/points.h"
#include "points/ply_header.h"

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
  const auto targets = prepare_batch(rows.info, rows.columns, {3, 2}, batch);
  EXPECT_EQ(batch.first, 3);
  EXPECT_EQ(batch.size(), 2);
  EXPECT_TRUE(batch.nx.empty() && batch.radius.empty());
  ASSERT_EQ(batch.attributes.size(), 1);
  EXPECT_EQ(targets[1].wide, batch.y.data());
  EXPECT_EQ(targets[3].narrow, batch.attributes[0].data());
}

using testing::HasSubstr;

std::string binary_header(const std::string& count, const std::string& before = "", const std::string& after = "") {
  return "ply\nformat binary_little_endian 1.0\n" + before + "element vertex " + count +
         "\nproperty float x\nproperty float y\nproperty float z\n" + after + "end_header\n";
}

class PlyWalk : public testing::Test {
 protected:
  std::string refusal(const std::string& bytes) {
    try {
      open_points(test::write_file(folder_ / "a.ply", bytes));
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ExitCode::unreadable);
      EXPECT_THAT(e.what(), HasSubstr("/a.ply: "));
      return e.what();
    }
    return "nothing";
  }
  test::TemporaryFolder folder_;
};

TEST_F(PlyWalk, ShortFilesSayWhatIsPromisedAndHeld) {
  EXPECT_THAT(refusal(binary_header("3") + std::string(35, 'a')),
              HasSubstr("the header promises 3 rows of element 'vertex', the file holds 2 of 12 bytes each"));
  EXPECT_THAT(refusal(binary_header("3")), HasSubstr("the file holds 0 of 12 bytes each"));
  EXPECT_THAT(refusal(binary_header("18446744073709551615") + std::string(12, 'a')),
              HasSubstr("promises 18446744073709551615 rows of element 'vertex', the file holds 1 of"));
}

TEST_F(PlyWalk, BytesTooManyAreRefusedBlanksAreNot) {
  EXPECT_THAT(refusal(binary_header("1") + std::string(24, 'a')),
              HasSubstr("12 bytes follow the last row the header promises"));
  EXPECT_THAT(refusal(binary_header("1") + std::string(12, 'a') + std::string(5000, ' ')),
              HasSubstr("5000 bytes follow"));
  EXPECT_EQ(refusal(binary_header("1") + std::string(12, 'a') + " \r\n\n"), "nothing");
}

TEST_F(PlyWalk, NoPointsAreAllowed) {
  EXPECT_EQ(refusal(binary_header("0")), "nothing");
  const auto source = open_points(folder_ / "a.ply");
  EXPECT_EQ(source->info().count, 0);
  SampleBatch batch;
  source->read(0, 10, batch);
  EXPECT_EQ(batch.size(), 0);
}

TEST_F(PlyWalk, ElementsAroundAreCheckedToo) {
  const std::string list = "element face 2\nproperty uchar flag\nproperty list short int vertex_indices\n";
  const std::string one_face = std::string("f\2\0", 3) + std::string(8, 'i');
  const std::string points(12, 'p');
  EXPECT_EQ(refusal(binary_header("1", "", list) + points + one_face + one_face), "nothing");
  EXPECT_EQ(refusal(binary_header("1", list) + one_face + one_face + points), "nothing");
  EXPECT_THAT(refusal(binary_header("1", "", list) + points + one_face + one_face.substr(0, 9)),
              HasSubstr("promises 2 rows of element 'face', the file holds 1:"));
  EXPECT_THAT(refusal(binary_header("1", "", list) + points + one_face + "f\2"),
              HasSubstr("'face', the file holds 1:"));
  EXPECT_THAT(refusal(binary_header("1", list) + one_face + "f\xff\xff" + points),
              HasSubstr("element 'face', row 1: list 'vertex_indices' has the length -1: the file is damaged"));
  const std::string endless = "element face 18446744073709551615\nproperty list uint double vertex_indices\n";
  EXPECT_THAT(refusal(binary_header("1", endless) + std::string(400'000, '\0')), HasSubstr("the file holds 100000:"));
  EXPECT_THAT(refusal(binary_header("1", endless) + std::string(400, '\xff')), HasSubstr("the file holds 0:"));
}

TEST_F(PlyWalk, FileCutWhileReadIsReported) {
  const std::string path = test::write_file(folder_ / "a.ply", binary_header("1000") + std::string(12'000, 'a'));
  const auto source = open_points(path);
  std::filesystem::resize_file(path, binary_header("1000").size() + 60);
  SampleBatch batch;
  try {
    source->read(0, 1000, batch);
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ExitCode::unreadable);
    EXPECT_THAT(e.what(), HasSubstr("a.ply: another program wrote to it while it was read"));
  }
}

}  // namespace

}  // namespace lamina

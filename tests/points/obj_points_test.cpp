// OBJ vertices as points: colours, normals by order or by faces, and what is left out.
#include "points/formats.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/temporary_folder.h"
#include "points/point_rows.h"

namespace lamina {
namespace {

using test::all_rows;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class ObjPoints : public ::testing::Test {
 protected:
  std::unique_ptr<PointSource> open(const std::string& text) const { return open_points(write(text)); }
  std::string write(const std::string& text) const { return test::write_file(folder_ / "cloud.obj", text); }
  test::TemporaryFolder folder_;
};

TEST_F(ObjPoints, VerticesWithNormalsInEitherOrder) {
  for (const char* text :
       {"v 1 2 3\nv 4 5 6\nvn 0 0 1\nvn 1 0 0\n", "# a\nmtllib b\nvn 0 0 1\nv 1 2 3\nvn 1 0 0\n v  4 5 6\r\n"}) {
    const auto source = open(text);
    EXPECT_TRUE(source->info().has_normals && source->info().random_access);
    EXPECT_THAT(source->info().remarks, IsEmpty());
    const SampleBatch rows = all_rows(*source);
    EXPECT_THAT(rows.x, ElementsAre(1, 4));
    EXPECT_THAT(rows.z, ElementsAre(3, 6));
    EXPECT_THAT(rows.nx, ElementsAre(0, 1));
    EXPECT_THAT(rows.nz, ElementsAre(1, 0));
  }
}

TEST_F(ObjPoints, ColoursOfBothKindsAndWeights) {
  const auto floats = open("v 1 2 3 0.5 0 1\nv 1 2 3 1 1 0\n");
  EXPECT_EQ(floats->info().attributes[0], (AttributeSpec{"red", ScalarType::float32}));
  EXPECT_THAT(all_rows(*floats).attributes[0], ElementsAre(0.5F, 1));
  const auto bytes = open("v 1 2 3 255 0 7 128\n");
  EXPECT_EQ(bytes->info().attributes[3], (AttributeSpec{"alpha", ScalarType::uint8}));
  EXPECT_THAT(open("v 1 2 3 1.0\n")->info().attributes, IsEmpty());
  EXPECT_THAT(test::refusal(write("v 1 2 3 4 5\n")), HasSubstr("line 1: 5 values on a vertex"));
}

TEST_F(ObjPoints, NormalsThatBelongToOtherVerticesAreLeftOut) {
  const std::string points = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nvn 0 1 0\nvn 1 0 0\n";
  EXPECT_TRUE(open(points + "f 1//1 2//2 3//3\n")->info().has_normals);
  EXPECT_TRUE(open(points + "f 1/9/1 2/9/2 3/9/3\nf 1/1 2/3 3/2\n")->info().has_normals);
  const auto mixed = open(points + "f 1//1 2//3 3//2\n");
  EXPECT_FALSE(mixed->info().has_normals);
  EXPECT_THAT(mixed->info().remarks, ElementsAre(HasSubstr("the faces give vertices the normals of others")));
  const auto fewer = open("v 0 0 0\nv 1 0 0\nvn 0 0 1\n");
  EXPECT_FALSE(fewer->info().has_normals);
  EXPECT_THAT(fewer->info().remarks, ElementsAre(HasSubstr("1 for 2 vertices")));
}

TEST_F(ObjPoints, AnyRowCanBeReadFirstAndBadOnesAreNamed) {
  std::string text;
  for (int i = 0; i < 10'000; ++i) text += fmt::format("v {} {} 0.5\nvn 0 0 {}\n", i, 2 * i, i);
  const auto source = open(text);
  SampleBatch batch;
  source->read(9'000, 3, batch);
  EXPECT_THAT(batch.y, ElementsAre(18'000, 18'002, 18'004));
  EXPECT_THAT(batch.nz, ElementsAre(9'000, 9'001, 9'002));
  EXPECT_THAT(test::refusal(write(text + "v 1 2\n")), HasSubstr("line 20001: 3 values expected, only 2 stand there"));
  EXPECT_THAT(test::refusal(write(text + "v 1 2 x\n")), HasSubstr("'x' is no number"));
  EXPECT_THAT(test::refusal(write("o nothing\n")), HasSubstr("holds no vertices"));
}

}  // namespace
}  // namespace lamina

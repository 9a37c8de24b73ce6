#include "lamina/edit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lamina/measure.h"
#include "support/program.h"
#include "tools/tool_files.h"

namespace lamina::tools {
namespace {

using namespace test;
using ::testing::HasSubstr;

class MergeTool : public ::testing::Test {
 protected:
  /// A cloud of `count` bare points with one attribute.
  std::string plain(const std::string& name, std::size_t count, const std::string& attribute, ScalarType type) {
    SampleBatch rows;
    for (std::size_t i = 0; i < count; ++i) rows.x.push_back(static_cast<double>(i));
    rows.y = rows.z = rows.x;
    rows.attributes = {std::vector<float>(count, 7)};
    PointColumns columns;
    columns.attributes = {{attribute, type}};
    return write_points(folder_ / name, rows, columns);
  }
  TemporaryFolder folder_;
  SampleBatch first_ = sphere_rows(300, 1), second_ = sphere_rows(200, 2);
  std::string a_ = write_points(folder_ / "a.ply", first_, sphere_columns());
  std::string b_ = write_points(folder_ / "b.ply", second_, sphere_columns());
  std::string out_ = folder_ / "out.ply";
};

TEST_F(MergeTool, AppendsAllRowsInOrder) {
  ASSERT_EQ(run_lamina({"merge", a_, b_, a_, "-o", out_}).code, 0);
  std::vector<std::string> expected = row_texts(first_);
  for (const auto* part : {&second_, &first_})
    for (const auto& text : row_texts(*part)) expected.push_back(text);
  EXPECT_EQ(row_texts(read_points(out_)), expected);
  const auto piped = run_shell("cat " + test::quoted(b_) + " | lamina merge " + test::quoted(a_) + " - " +
                               test::quoted(a_) + " -o - --quiet");
  EXPECT_TRUE(piped.out == read_text(out_)) << piped.err;
}

TEST_F(MergeTool, MixedAttributesAreRefusedByName) {
  const std::string c = plain("c.ply", 5, "red", ScalarType::uint8);
  const auto refused = run_lamina({"merge", a_, c, "-o", out_});
  EXPECT_EQ(refused.code, 3);
  EXPECT_THAT(refused.err, HasSubstr("c.ply: has no normals"));
  EXPECT_THAT(refused.err, HasSubstr("--mixed"));
  EXPECT_EQ(run_lamina({"merge", plain("d.ply", 1, "p", ScalarType::int8), plain("e.ply", 1, "q", ScalarType::int8),
                        "-o", out_})
                .code,
            3);
  const auto colours =
      run_lamina({"merge", c, plain("f.ply", 5, "red", ScalarType::uint16), "--mixed", "fill", "-o", out_});
  EXPECT_EQ(colours.code, 3) << "8-bit and 16-bit colours do not mix";
}

TEST_F(MergeTool, FillsOrLeavesOutWhatNotAllHave) {
  const std::string c = plain("c.ply", 5, "red", ScalarType::uint8), d = plain("d.ply", 3, "class", ScalarType::int16);
  ASSERT_EQ(run_lamina({"merge", a_, c, d, "--mixed", "fill", "-o", out_}).code, 0);
  const auto filled = open_points(out_);
  EXPECT_FALSE(filled->info().has_normals) << "normals cannot be made up";
  EXPECT_EQ(filled->info().quality_name, "confidence");
  ASSERT_EQ(filled->info().attributes.size(), 5U);
  const SampleBatch rows = read_points(out_);
  ASSERT_EQ(rows.size(), 308U);
  EXPECT_EQ(rows.attributes[0][0], first_.attributes[0][0]);
  EXPECT_EQ(rows.exact[3][10], first_.exact[3][10]);
  EXPECT_EQ(rows.attributes[0][300], 7);  // red of c
  EXPECT_EQ(rows.attributes[1][300], 0);  // green, which c has not
  EXPECT_EQ(rows.quality[300], 1);
  EXPECT_EQ(rows.attributes[4][305], 7);  // class of d
  EXPECT_EQ(rows.attributes[4][0], 0);
  ASSERT_EQ(run_lamina({"merge", a_, c, "--mixed", "intersect", "-o", out_}).code, 0);
  EXPECT_EQ(open_points(out_)->info().attributes, (AttributeLayout{{"red", ScalarType::uint8}}));
}

TEST_F(MergeTool, TypesGrowToHoldBoth) {
  const std::string c = plain("c.ply", 1, "v", ScalarType::int8), d = plain("d.ply", 1, "v", ScalarType::uint16);
  ASSERT_EQ(run_lamina({"merge", c, d, "--mixed", "fill", "-o", out_}).code, 0);
  EXPECT_EQ(open_points(out_)->info().attributes[0].type, ScalarType::int32);
  EXPECT_EQ(run_lamina({"merge", c, d, "-o", out_}).code, 3);
}

TEST_F(MergeTool, MeshesStandBesideEachOther) {
  const std::string small = sphere_mesh(folder_ / "small.ply", 0.5), large = sphere_mesh(folder_ / "large.obj", 2);
  ASSERT_EQ(run_lamina({"merge", small, large, "-o", out_}).code, 0);
  const MeshMeasures both = measure_mesh(read_mesh(out_));
  const MeshMeasures one = measure_mesh(read_mesh(small)), two = measure_mesh(read_mesh(large));
  EXPECT_EQ(both.parts.size(), 2U);
  EXPECT_EQ(both.triangles, one.triangles + two.triangles);
  EXPECT_NEAR(*both.volume, *one.volume + *two.volume, 1e-9);
  EXPECT_EQ(run_lamina({"merge", small, a_, "-o", out_}).code, 2) << "a mesh and points";
}

TEST_F(MergeTool, AnswersMistakesWithTheirCodes) {
  EXPECT_EQ(run_lamina({"merge", "-o", out_}).code, 2);
  EXPECT_EQ(run_lamina({"merge", a_, folder_ / "none.ply", "-o", out_}).code, 3);
  EXPECT_EQ(run_lamina({"merge", a_, "-o", folder_ / "no/such.ply"}).code, 4);
}

}  // namespace
}  // namespace lamina::tools

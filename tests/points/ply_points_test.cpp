#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/temporary_folder.h"
#include "lamina/error.h"
#include "lamina/points.h"

namespace lamina {
namespace {

using testing::HasSubstr;

std::string header(const std::string& count, const std::string& more = "") {
  return "ply\nformat ascii 1.0\nelement vertex " + count + "\nproperty float x\nproperty float y\nproperty float z\n" +
         more + "end_header\n";
}

class PlyAscii : public testing::Test {
 protected:
  SampleBatch read(const std::string& bytes) {
    const auto source = open_points(test::write_file(folder_ / "a.ply", bytes));
    EXPECT_FALSE(source->info().random_access);
    SampleBatch batch;
    source->read(0, 1000, batch);
    return batch;
  }
  std::string refusal(const std::string& bytes) {
    try {
      read(bytes);
    } catch (const Error& e) {
      EXPECT_EQ(e.code(), ExitCode::unreadable);
      EXPECT_THAT(e.what(), HasSubstr("/a.ply"));
      return e.what();
    }
    return "nothing";
  }
  test::TemporaryFolder folder_;
};

TEST_F(PlyAscii, SpacesBlankLinesAndMissingLastEndAreTolerated) {
  const SampleBatch batch = read(header("3") + "\n  1\t2   3 \r\n\n+4 -5 6e1\n \t\n7 8 .5");
  EXPECT_EQ(batch.x, (std::vector<double>{1, 4, 7}));
  EXPECT_EQ(batch.y, (std::vector<double>{2, -5, 8}));
  EXPECT_EQ(batch.z, (std::vector<double>{3, 60, 0.5}));
}

TEST_F(PlyAscii, LinesMayEndInCarriageReturnAlone) {
  std::string text = header("2") + "1 2 3\n4 5 6\n";
  std::replace(text.begin(), text.end(), '\n', '\r');
  EXPECT_EQ(read(text).z, (std::vector<double>{3, 6}));
}

TEST_F(PlyAscii, WordsForNoNumberAreValues) {
  const SampleBatch batch = read(header("2") + "nan -nan NAN\ninf -inf Infinity\n");
  EXPECT_TRUE(std::isnan(batch.x[0]) && std::isnan(batch.y[0]) && std::isnan(batch.z[0]));
  EXPECT_EQ(batch.x[1], HUGE_VAL);
  EXPECT_EQ(batch.y[1], -HUGE_VAL);
  EXPECT_EQ(batch.z[1], HUGE_VAL);
}

TEST_F(PlyAscii, NumbersOutOfRange) {
  const SampleBatch batch = read(header("2") + "1e400 -1e400 1e-400\n-1e99999 1e-99999 -1e-99999\n");
  EXPECT_EQ(batch.x, (std::vector<double>{HUGE_VAL, -HUGE_VAL}));
  EXPECT_EQ(batch.y, (std::vector<double>{-HUGE_VAL, 0}));
  EXPECT_EQ(batch.z, (std::vector<double>{0, 0}));
}

TEST_F(PlyAscii, PositionsKeepTheirDigits) {
  EXPECT_EQ(read(header("1") + "437123.1234 4829123.9876 12.5\n").y, std::vector<double>{4829123.9876});
}

TEST_F(PlyAscii, BadRowsNameLineAndProperty) {
  EXPECT_THAT(refusal(header("2") + "1 2 3\n4.25 5.25\n"),
              HasSubstr("a.ply, line 9 (vertex 1): 3 values expected, only 2 stand there ('z' is missing)"));
  EXPECT_THAT(refusal(header("2") + "1 2 3\n\n4 5 6 7\n"),
              HasSubstr("a.ply, line 10 (vertex 1): 3 values expected, more stand there, from '7' on"));
  EXPECT_THAT(refusal(header("1") + "1 a.5 3\n"),
              HasSubstr("line 8 (vertex 0): 'a.5' is no number (property 'y' expected)"));
  EXPECT_THAT(refusal(header("1") + "1 2,5 3\n"), HasSubstr("'2,5' is no number"));
  EXPECT_THAT(refusal(header("1") + "1 2 3x\n"), HasSubstr("'3x' is no number"));
  EXPECT_THAT(refusal(header("1") + "1 +-2 3\n"), HasSubstr("'+-2' is no number"));
  EXPECT_THAT(refusal(header("1") + std::string("1 \0 3\n", 6)), HasSubstr("'?' is no number"));
}

TEST_F(PlyAscii, ValuesMustBeOfTheirIntegerType) {
  const std::string red = header("1", "property uchar red\n");
  EXPECT_EQ(read(red + "1 2 3 255.0\n").attributes[0], std::vector<float>{255});
  EXPECT_THAT(refusal(red + "1 2 3 0.5\n"), HasSubstr("property 'red' is '0.5', which is no uchar as the header says"));
  EXPECT_THAT(refusal(red + "1 2 3 256\n"), HasSubstr("is no uchar"));
  EXPECT_THAT(refusal(red + "1 2 3 -1\n"), HasSubstr("is no uchar"));
  EXPECT_THAT(refusal(red + "1 2 3 nan\n"), HasSubstr("is no uchar"));
  EXPECT_THAT(refusal(header("1", "property int i\n") + "1 2 3 3000000000\n"), HasSubstr("is no int"));
}

TEST_F(PlyAscii, CountsMustAgreeWithTheFile) {
  EXPECT_THAT(refusal(header("3") + "1 2 3\n4 5.125 6.125\n"),
              HasSubstr("promises 3 rows of element 'vertex', the file holds 2 (to line 9)"));
  EXPECT_THAT(refusal(header("1000000000000") + "1 2 3\n"), HasSubstr("the file holds at most 1:"));
  EXPECT_THAT(refusal(header("18446744073709551615")), HasSubstr("the file holds at most 0:"));
  EXPECT_THAT(refusal(header("1") + "1 2 3\n4 5 6\n"), HasSubstr("a.ply, line 9: more rows than the header promises"));
  EXPECT_THAT(refusal(header("0") + "1 2 3\n"), HasSubstr("a.ply, line 8: more rows"));
  EXPECT_EQ(refusal(header("0")), "nothing");
}

TEST_F(PlyAscii, ElementsBehindMustBeThere) {
  const std::string face = header("2", "element face 2\nproperty list uchar int vertex_indices\n");
  EXPECT_EQ(refusal(face + "1 2 3\n4 5 6\n3 0 1 0\n3 1 0 1\n"), "nothing");
  EXPECT_THAT(refusal(face + "1 2 3\n4 5 6\n3 0 1 0\n"),
              HasSubstr("promises 2 rows of element 'face', the file holds 1"));
  EXPECT_THAT(refusal(face + "1 2 3\n4 5 6\n7 8 9\n3 0 1 0\n3 1 0 1\n"), HasSubstr("line 14: more rows"));
}

TEST_F(PlyAscii, ReadingOutOfOrderIsADefect) {
  const auto source = open_points(test::write_file(folder_ / "a.ply", header("3") + "1 2 3\n4 5 6\n7 8 9\n"));
  SampleBatch batch;
  source->read(0, 1, batch);
  EXPECT_THROW(source->read(2, 1, batch), Error);
  source->read(1, 1, batch);
  EXPECT_EQ(batch.x, std::vector<double>{4});
  source->read(0, 3, batch);
  EXPECT_EQ(batch.x, (std::vector<double>{1, 4, 7}));
}

}  // namespace
}  // namespace lamina

// Counts of binary files against what the files hold.
#include "points/ply_walk.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/temporary_folder.h"
#include "lamina/error.h"
#include "lamina/points.h"

namespace lamina {
namespace {

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

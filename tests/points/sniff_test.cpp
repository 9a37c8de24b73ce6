#include "points/sniff.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lamina/error.h"

namespace lamina {
namespace {

using testing::HasSubstr;
using testing::StartsWith;
using namespace std::string_view_literals;

std::string refusal(std::string_view start) {
  try {
    require_ply(start, "cloud.bin");
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ExitCode::unreadable);
    EXPECT_THAT(e.what(), StartsWith("cloud.bin"));
    return e.what();
  }
  return "";
}

TEST(Sniff, TakesPly) {
  for (const auto start : {"ply\nformat"sv, "ply\r\nformat"sv, "ply\rformat"sv, "ply \n"sv})
    EXPECT_EQ(refusal(start), "");
}

TEST(Sniff, NamesWhatItLooksLike) {
  std::string las = "LASF" + std::string(200, '\0');
  EXPECT_THAT(refusal(las), HasSubstr("LAS is not read yet"));
  las[104] = '\x83';
  EXPECT_THAT(refusal(las), HasSubstr("LAZ is not read yet"));
  EXPECT_THAT(refusal("# .PCD v0.7 - Point Cloud\n"), HasSubstr("PCD is not read yet"));
  EXPECT_THAT(refusal("ASTM-E57\1"), HasSubstr("E57 is not read yet"));
  EXPECT_THAT(refusal("0.1 -2e3 4\n1 2 3\n"), HasSubstr("XYZ is not read yet"));
  EXPECT_THAT(refusal("# made by hand\n1,2,3,4,5,6\n"), HasSubstr("(6 numbers on a line)"));
  EXPECT_THAT(refusal("\x1f\x8b\x08"), HasSubstr("gzip"));
  EXPECT_THAT(refusal("version https://git-lfs.github.com/spec/v1"), HasSubstr("git lfs pull"));
}

TEST(Sniff, OtherwiseSaysItIsNoPly) {
  EXPECT_THAT(refusal("plyx\n"), HasSubstr("is not a PLY file"));
  EXPECT_THAT(refusal("\0\0\0\0\0"sv), HasSubstr("is not a PLY file"));
  EXPECT_THAT(refusal("1 2\n3 4\n"), HasSubstr("is not a PLY file"));
  EXPECT_THAT(refusal("#"), HasSubstr("is not a PLY file"));
  EXPECT_THAT(refusal(""), HasSubstr("is empty"));
  EXPECT_THAT(refusal("ply"), HasSubstr("ends after its first line"));
}

}  // namespace
}  // namespace lamina

#include "lamina/file_ending.h"

#include <gtest/gtest.h>

namespace lamina {
namespace {

TEST(FileEnding, IsTheLastInLowerCase) {
  EXPECT_EQ(file_ending("scans.d/Lion.PLY"), ".ply");
  EXPECT_EQ(file_ending("lion.tar.gz"), ".gz");
  EXPECT_EQ(file_ending("lion.ply.tmp"), ".tmp");
}

TEST(FileEnding, IsNoneWithoutADot) {
  EXPECT_EQ(file_ending("scans.d/lion"), "");
  EXPECT_EQ(file_ending("-"), "");
  EXPECT_EQ(file_ending(""), "");
  EXPECT_EQ(file_ending(".ply"), "") << "a hidden file";
}

TEST(FileEnding, OfPackedFilesIsTheOneBefore) {
  EXPECT_EQ(packed_ending("lion.ply.gz"), ".ply");
  EXPECT_EQ(packed_ending("LION.OBJ.GZ"), ".obj");
  EXPECT_EQ(packed_ending("lion.ply"), ".ply");
  EXPECT_EQ(packed_ending("lion.gz"), "");
}

}  // namespace
}  // namespace lamina

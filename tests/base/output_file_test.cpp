#include "base/output_file.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>

#include "base/temporary_folder.h"

namespace lamina {
namespace {

class Staged : public ::testing::Test {
 protected:
  test::TemporaryFolder folder_;
  const std::string path_ = folder_ / "mesh.ply";
};

TEST_F(Staged, AppearsWholeAndOnlyWhenPublished) {
  test::write_file(path_, "older");
  StagedFile file(path_);
  ASSERT_TRUE(file);
  ASSERT_EQ(write_all(file.fd(), "newer", 5), 0);
  EXPECT_EQ(test::read_file(path_), "older");
  EXPECT_EQ(file.publish(path_), 0);
  EXPECT_EQ(test::read_file(path_), "newer");
  EXPECT_EQ(folder_.entries(), 1);
}

TEST_F(Staged, LeavesNothingWhenItIsNot) {
  {
    const StagedFile file(path_);
    ASSERT_TRUE(file);
    ASSERT_EQ(write_all(file.fd(), "newer", 5), 0);
  }
  EXPECT_EQ(folder_.entries(), 0);
}

TEST_F(Staged, TakesAnotherNameOfTheSameFolder) {
  StagedFile file(path_);
  ASSERT_EQ(write_all(file.fd(), "one", 3), 0);
  EXPECT_EQ(file.publish(folder_ / "mesh.0001.ply"), 0);
  EXPECT_EQ(test::read_file(folder_ / "mesh.0001.ply"), "one");
  EXPECT_EQ(folder_.entries(), 1);
}

TEST_F(Staged, WhatAKilledRunLeftGoesAndWhatALivingOneHoldsStays) {
  const std::string dead = folder_ / ".mesh.ply.partial-1", alive = folder_ / ".mesh.ply.partial-2",
                    other = folder_ / ".other.ply.partial-1";
  for (const std::string& name : {dead, alive, other}) test::write_file(name, "part");
  const Descriptor holder(::open(alive.c_str(), O_RDONLY));
  ASSERT_EQ(::flock(holder.get(), LOCK_EX), 0);
  const StagedFile file(path_);
  EXPECT_FALSE(std::filesystem::exists(dead));
  EXPECT_TRUE(std::filesystem::exists(alive));
  EXPECT_TRUE(std::filesystem::exists(other));
}

TEST_F(Staged, AHiddenNameThatIsTakenIsNoHindrance) {
  // A living run of the same process number, as in another container on the same disk.
  const std::string taken = folder_ / (".mesh.ply.partial-" + std::to_string(::getpid()));
  test::write_file(taken, "theirs");
  const Descriptor holder(::open(taken.c_str(), O_RDONLY));
  ASSERT_EQ(::flock(holder.get(), LOCK_EX), 0);
  StagedFile file(path_);
  ASSERT_EQ(write_all(file.fd(), "ours", 4), 0);
  EXPECT_EQ(file.publish(path_), 0);
  EXPECT_EQ(test::read_file(path_), "ours");
  EXPECT_EQ(test::read_file(taken), "theirs");
}

TEST_F(Staged, SaysWhyItCannotBe) {
  const StagedFile file(folder_ / "none/mesh.ply");
  EXPECT_EQ(errno, ENOENT);
  EXPECT_FALSE(file);
  StagedFile moved;
  moved = StagedFile(path_);
  EXPECT_TRUE(moved);
  EXPECT_EQ(moved.publish(folder_ / "none/mesh.ply"), ENOENT);
}

}  // namespace
}  // namespace lamina

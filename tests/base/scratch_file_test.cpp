#include "base/scratch_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>

#include "base/temporary_folder.h"
#include "lamina/error.h"

namespace lamina {
namespace {

using Pair = std::array<int, 2>;
constexpr Pair kFirst{1, 2}, kSecond{3, 4};

TEST(ScratchFile, GivesBackWhatWasWrittenAndLeavesNoName) {
  const test::TemporaryFolder folder;
  ScratchFile file(folder.path());
  file.write(std::as_bytes(std::span(kFirst)));
  file.write(std::as_bytes(std::span(kSecond)));
  Pair middle{};
  file.read(sizeof(int), std::as_writable_bytes(std::span(middle)));
  EXPECT_EQ(middle, (Pair{2, 3}));
  EXPECT_EQ(folder.entries(), 0);
}

TEST(ScratchFile, ReadingPastItsEndNamesTheFolderAndTheRemedy) {
  const test::TemporaryFolder folder;
  ScratchFile file(folder.path());
  file.write(std::as_bytes(std::span(kFirst)));
  Pair rows{};
  try {
    file.read(sizeof(int), std::as_writable_bytes(std::span(rows)));
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ExitCode::budget);
    EXPECT_THAT(e.what(), testing::AllOf(testing::HasSubstr(folder.path()), testing::HasSubstr("--tmp-dir")));
  }
}

}  // namespace
}  // namespace lamina

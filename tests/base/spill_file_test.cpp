#include "base/spill_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

#include "base/temporary_folder.h"
#include "lamina/error.h"

namespace lamina {
namespace {

using Pair = std::array<int, 2>;
constexpr Pair kFirst{1, 2}, kSecond{3, 4};

TEST(SpillFile, GivesBackWhatWasWrittenAndLeavesNoName) {
  const test::TemporaryFolder folder;
  SpillFile file(folder.path());
  EXPECT_EQ(file.append(std::as_bytes(std::span(kFirst))), 0U);
  EXPECT_EQ(file.append(std::as_bytes(std::span(kSecond))), sizeof(Pair));
  EXPECT_EQ(file.size(), 2 * sizeof(Pair));
  file.flush();
  Pair middle{};
  file.read(sizeof(int), std::as_writable_bytes(std::span(middle)));
  EXPECT_EQ(middle, (Pair{2, 3}));
  EXPECT_EQ(folder.entries(), 0);
}

TEST(SpillFile, ReadingPastItsEndNamesTheFolderAndTheRemedy) {
  const test::TemporaryFolder folder;
  SpillFile file(folder.path());
  file.append(std::as_bytes(std::span(kFirst)));
  file.flush();
  Pair rows{};
  try {
    file.read(sizeof(int), std::as_writable_bytes(std::span(rows)));
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ExitCode::budget);
    EXPECT_THAT(e.what(), testing::AllOf(testing::HasSubstr(folder.path()), testing::HasSubstr("--tmp-dir"),
                                         testing::HasSubstr("at byte 8: it ends there")));
  }
}

TEST(SpillFile, GivesPiecesInOrderFromWhatIsLeft) {
  const test::TemporaryFolder folder;
  SpillFile file(folder.path());
  std::vector<std::uint32_t> numbers(100'000);  // more than a buffer
  std::iota(numbers.begin(), numbers.end(), 0U);
  file.append(std::as_bytes(std::span(numbers)));
  file.flush();
  file.discard_before(40);
  EXPECT_EQ(file.begin(), 40U);
  std::vector<std::byte> all;
  file.read_through(997, [&](std::span<const std::byte> piece) { all.insert(all.end(), piece.begin(), piece.end()); });
  const auto left = std::as_bytes(std::span(numbers)).subspan(40);
  EXPECT_TRUE(std::equal(all.begin(), all.end(), left.begin(), left.end()));
}

TEST(SpillFile, BeginsAnewWhenNothingIsLeft) {
  const test::TemporaryFolder folder;
  SpillFile file(folder.path());
  file.append(std::as_bytes(std::span(kFirst)));
  file.flush();
  file.discard_before(file.size());
  EXPECT_EQ(file.begin(), 0U);
  EXPECT_EQ(file.append(std::as_bytes(std::span(kSecond))), 0U);
  file.flush();
  Pair back{};
  file.read(0, std::as_writable_bytes(std::span(back)));
  EXPECT_EQ(back, kSecond);
}

}  // namespace
}  // namespace lamina

#include "base/free_memory.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <fstream>
#include <memory>
#include <vector>

namespace lamina::test {
namespace {

/// Pages of the program that are in memory.
std::uint64_t resident_pages() {
  std::ifstream file("/proc/self/statm");
  std::uint64_t all = 0, resident = 0;
  file >> all >> resident;
  return resident;
}

TEST(FreeMemory, GapsBetweenArraysGoBackToTheSystem) {
  constexpr std::size_t kArrays = 2000, kBytes = 32 << 10, kPage = 4096;
  std::vector<std::unique_ptr<std::vector<char>>> arrays;
  for (std::size_t i = 0; i < kArrays; ++i) arrays.push_back(std::make_unique<std::vector<char>>(kBytes, 'x'));
  // One stays of each eight, so that the heap cannot shrink by its end.
  for (std::size_t i = 0; i < kArrays; ++i) {
    if (i % 8 != 7) arrays[i].reset();
  }
  return_free_memory();
  const std::uint64_t left = resident_pages();
  for (std::size_t i = 0; i < kArrays; ++i) {
    if (i % 8 != 7) arrays[i] = std::make_unique<std::vector<char>>(kBytes, 'x');
  }
  EXPECT_GT(resident_pages(), left + kArrays / 2 * kBytes / kPage);
  for (std::size_t i = 7; i < kArrays; i += 8) EXPECT_EQ(arrays[i]->back(), 'x');
}

}  // namespace
}  // namespace lamina::test

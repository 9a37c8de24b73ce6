#include "base/nth_value.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <random>
#include <span>
#include <vector>

namespace lamina {
namespace {

void expect_as_sorted(const std::vector<float>& values) {
  std::vector<float> sorted = values;
  std::sort(sorted.begin(), sorted.end());
  const std::size_t step = std::max<std::size_t>(1, values.size() / 37);
  for (std::size_t nth = 0; nth < values.size(); nth += step) {
    std::vector<float> taken = values;
    EXPECT_EQ(nth_value(std::span<float>(taken), nth), sorted[nth]) << nth << " of " << values.size();
    std::sort(taken.begin(), taken.end());
    EXPECT_EQ(taken, sorted);  // none is lost
  }
}

TEST(NthValue, IsTheOneThatSortingPutsThere) {
  std::mt19937 random(7);
  for (const std::size_t size : {1U, 2U, 24U, 25U, 100U, 5'000U}) {
    std::vector<float> values(size);
    for (float& v : values) v = static_cast<float>(random() % 1'000'000U);
    expect_as_sorted(values);
  }
}

TEST(NthValue, TakesValuesThatAreEqualOrInOrder) {
  std::vector<float> few(1'000), ascending(1'000), equal(1'000, 3.0F);
  for (std::size_t i = 0; i < few.size(); ++i) {
    few[i] = static_cast<float>(i * 7 % 3);
    ascending[i] = static_cast<float>(i);
  }
  for (std::vector<float>* values : {&few, &ascending, &equal}) expect_as_sorted(*values);
  std::reverse(ascending.begin(), ascending.end());
  expect_as_sorted(ascending);
}

}  // namespace
}  // namespace lamina

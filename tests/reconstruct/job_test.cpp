#include "reconstruct/job.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <thread>

namespace lamina {
namespace {

TEST(Stopwatch, BooksTimesOnStagesInOrderOfTheirFirst) {
  Stopwatch watch;
  const auto nap = [] { std::this_thread::sleep_for(std::chrono::milliseconds(5)); };
  watch.time("b", nap);
  watch.time("a", [] {});
  watch.time("b", nap);
  ASSERT_EQ(watch.stages().size(), 2u);
  EXPECT_EQ(watch.stages()[0].stage, "b");
  EXPECT_EQ(watch.stages()[1].stage, "a");
  EXPECT_GE(watch.stages()[0].wall, 0.01);
  EXPECT_LT(watch.stages()[1].wall, watch.stages()[0].wall);
}

TEST(Stopwatch, SleepIsWallTimeNotProcessorTime) {
  Stopwatch watch;
  watch.time("sleep", [] { std::this_thread::sleep_for(std::chrono::milliseconds(50)); });
  EXPECT_GE(watch.stages()[0].wall, 0.05);
  EXPECT_LT(watch.stages()[0].cpu, 0.04);
}

TEST(Stopwatch, WhatIsThrownPasses) {
  Stopwatch watch;
  EXPECT_THROW(watch.time("a", [] { throw std::runtime_error("no"); }), std::runtime_error);
}

}  // namespace
}  // namespace lamina

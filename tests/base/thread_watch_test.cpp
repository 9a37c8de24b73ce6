#include "base/thread_watch.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <chrono>
#include <latch>
#include <thread>

namespace lamina {
namespace {

constexpr double kAWhile = 0.05;

void rest() {
  std::this_thread::sleep_for(std::chrono::duration<double>(kAWhile));
}

TEST(ThreadWatch, OneThreadOfTwoIsNotAll) {
  tbb::task_arena arena(2);
  const ThreadWatch watch(arena, 2);
  arena.execute(rest);
  EXPECT_GE(watch.partly_idle(), 0.9 * kAWhile);
}

TEST(ThreadWatch, AllOfThemAtWorkAreNotIdle) {
  tbb::task_arena alone(1);
  const ThreadWatch of_one(alone, 1);
  double before = of_one.partly_idle();
  alone.execute([&] {
    before = of_one.partly_idle();
    rest();
    EXPECT_EQ(of_one.partly_idle(), before);
  });
  if (tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism) < 2) return;
  tbb::task_arena arena(2);
  const ThreadWatch of_two(arena, 2);
  std::latch both(2);
  std::latch done(2);
  arena.execute([&] {
    tbb::parallel_for(
        0, 2,
        [&](int) {
          both.arrive_and_wait();
          const double idle = of_two.partly_idle();
          rest();
          EXPECT_EQ(of_two.partly_idle(), idle);
          done.arrive_and_wait();
        },
        tbb::simple_partitioner());
  });
}

}  // namespace
}  // namespace lamina

// Wall and processor seconds by stage.
#pragma once
#include <chrono>
#include <ctime>
#include <string_view>
#include <vector>

#include "lamina/surface.h"

namespace lamina {

class Stopwatch {
 public:
  struct Moment {
    double wall, cpu;
  };
  static Moment now() {
    timespec t{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    const auto wall = std::chrono::steady_clock::now().time_since_epoch();
    return {std::chrono::duration<double>(wall).count(),
            static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec)};
  }

  /// Runs `work` and books its time on a stage.
  template <typename Work>
  void time(std::string_view stage, Work&& work) {
    const Moment before = now();
    work();
    const Moment after = now();
    StageTime& s = find(stage);
    s.wall += after.wall - before.wall;
    s.cpu += after.cpu - before.cpu;
  }
  [[nodiscard]] const std::vector<StageTime>& stages() const { return stages_; }

 private:
  StageTime& find(std::string_view stage) {
    for (StageTime& s : stages_) {
      if (s.stage == stage) return s;
    }
    return stages_.emplace_back(StageTime{std::string(stage), 0, 0});
  }
  std::vector<StageTime> stages_;
};

}  // namespace lamina

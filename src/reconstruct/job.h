// What the jobs that reconstruct have in common: a run with its clock and its statistics, the plan made and told, and
// the sweep through the slabs.
#pragma once
#include <chrono>
#include <ctime>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/thread_watch.h"
#include "lamina/points.h"
#include "lamina/run.h"
#include "lamina/surface.h"
#include "reconstruct/mesh_output.h"
#include "reconstruct/plan.h"
#include "reconstruct/stored_cloud.h"

namespace lamina {

class SurfaceVolume;

/// Wall and processor seconds by stage.
class Stopwatch {
 public:
  struct Moment {
    double wall, cpu;
  };
  /// Asks `threads`, which must outlive the last time(), how well they are used.
  void watch(const ThreadWatch& threads) { threads_ = &threads; }
  [[nodiscard]] double partly_idle() const { return threads_ == nullptr ? 0 : threads_->partly_idle(); }

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
    const double idle_before = partly_idle();
    work();
    const double idle = partly_idle() - idle_before;
    const Moment after = now();
    StageTime& s = find(stage);
    s.partly_idle += idle;
    s.wall += after.wall - before.wall;
    s.cpu += after.cpu - before.cpu;
  }
  [[nodiscard]] const std::vector<StageTime>& stages() const { return stages_; }

 private:
  StageTime& find(std::string_view stage) {
    for (StageTime& s : stages_) {
      if (s.stage == stage) return s;
    }
    return stages_.emplace_back(StageTime{std::string(stage), 0, 0, 0});
  }
  std::vector<StageTime> stages_;
  const ThreadWatch* threads_ = nullptr;
};

/// One run of a job: where it reports to, what it has taken, what it has counted.
struct Job {
  explicit Job(const RunContext& context) : run(context) {}
  Job(const Job&) = delete;
  Job& operator=(const Job&) = delete;

  const RunContext& run;
  Stopwatch watch;
  Stopwatch::Moment began = Stopwatch::now();
  SurfaceStats stats;
  std::unique_ptr<PointsWriter> rejected;  ///< has the samples left out, where these are wanted; not committed

  /// Wall seconds since the job began.
  [[nodiscard]] double elapsed() const { return Stopwatch::now().wall - began.wall; }
  /// Times and memory of the whole process go into the statistics.
  void finish();
};

/// Runs `work` with the threads and in the arena of a run.
void run_in_arena(const RunContext& run, const std::function<void()>& work);
/// The same, and the job's stopwatch sees how well the threads are used.
void run_in_arena(Job& job, const std::function<void()>& work);

/// The cloud's plan, told to the user and in job.stats. Throws Error(empty) where the samples lie too far apart,
/// Error(budget) where they need too much memory, and what make_plan() throws.
ReconstructionPlan plan_surface(const SurfaceSettings& settings, const StoredCloud& cloud, Job& job);

/// Where the sweep's results go.
struct SweepOutput {
  SlabSink& mesh;
  SurfaceVolume* volume = nullptr;  ///< none where no grids are asked for; a sweep with one is through all slabs
};

/// The sweep through `span` of plan.slabs: finished slabs go to the sink (see Pipeline). Fills in the stats of stages.
void sweep(const ReconstructionPlan& plan, StoredCloud& cloud, const SlabSpan& span, const SweepOutput& output,
           Job& job);

/// Throws Error(empty) for a mesh without triangles.
[[noreturn]] void no_surface(const ReconstructionPlan& plan);

}  // namespace lamina

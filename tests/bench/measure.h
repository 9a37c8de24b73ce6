// How a benchmark times one stage of many.
#pragma once
#include <benchmark/benchmark.h>

#include <cstdint>

#include "reconstruct/job.h"

namespace lamina::bench {

/// Times `work(subject)` by the processor time of all threads (what else the machine does does not count), `prepare()`
/// apart. Reports samples per second and its inverse.
template <typename Prepare, typename Work>
void measure(benchmark::State& state, std::uint64_t samples, const Prepare& prepare, const Work& work) {
  for ([[maybe_unused]] auto iteration : state) {
    auto subject = prepare();
    const Stopwatch::Moment before = Stopwatch::now();
    work(subject);
    state.SetIterationTime(Stopwatch::now().cpu - before.cpu);
  }
  const auto all = static_cast<double>(state.iterations()) * static_cast<double>(samples);
  state.SetItemsProcessed(static_cast<std::int64_t>(all));
  state.counters["per_sample"] = benchmark::Counter(all, benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

/// Registers a benchmark timed by measure().
template <typename Body>
void add(const std::string& name, const Body& body) {
  constexpr int kIterations = 5;
  benchmark::RegisterBenchmark(name.c_str(), body)
      ->UseManualTime()
      ->Iterations(kIterations)
      ->Unit(benchmark::kMillisecond);
}

}  // namespace lamina::bench

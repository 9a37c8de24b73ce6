// Benchmarks of kernels and stages. Usage: lamina_bench [--threads N] [--samples N] [Google Benchmark's options]
#include <benchmark/benchmark.h>
#include <fmt/format.h>
#include <tbb/global_control.h>

#include <cstdlib>
#include <string_view>

#include "base/temporary_folder.h"
#include "bench/benches.h"

int main(int argc, char** argv) {
  using namespace lamina;
  benchmark::Initialize(&argc, argv);
  std::size_t threads = 1;
  std::uint64_t samples = 300'000;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    const bool known = (word == "--threads" || word == "--samples") && i + 1 < argc;
    const std::uint64_t value = known ? std::strtoull(argv[i + 1], nullptr, 10) : 0;
    if (value == 0) {
      fmt::print(stderr, "usage: lamina_bench [--threads N] [--samples N] [--benchmark_...]\n");
      return 2;
    }
    if (word == "--threads") threads = value;
    if (word == "--samples") samples = value;
    ++i;
  }
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
  const test::TemporaryFolder folder;
  const bench::Scene plain = bench::make_scene("bumpy-sphere", samples, false, folder.path());
  const bench::Scene coloured = bench::make_scene("bumpy-sphere", samples, true, folder.path());
  bench::add_input_benches(plain, "");
  bench::add_input_benches(coloured, "/colour");
  bench::add_normal_benches(plain);
  bench::add_kernel_benches();
  bench::add_project_benches(plain, "");
  bench::add_project_benches(coloured, "/colour");
  bench::add_stage_benches(plain, "");
  bench::add_stage_benches(coloured, "/colour");
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}

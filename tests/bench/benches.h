// The benchmarks by room; each call registers a few. Scenes must outlive the runs.
#pragma once
#include "bench/scene.h"

namespace lamina::bench {

void add_input_benches(const Scene& scene, const std::string& suffix);
void add_kernel_benches();
void add_normal_benches(const Scene& scene);
void add_project_benches(const Scene& scene, const std::string& suffix);
void add_stage_benches(const Scene& scene, const std::string& suffix);

}  // namespace lamina::bench

// What a run is expected to take: memory, temporary disk, processor time. The models' coefficients are fitted to runs
// of 1 M to 380 M samples (docs/performance.md).
#pragma once
#include <cstdint>

#include "reconstruct/plan.h"

namespace lamina {

/// Of the mesh.
double expected_triangles(const ReconstructionPlan& plan);

/// Bytes at the peak without a volume and without the window's look-up tables.
std::uint64_t expected_mesh_memory(const ReconstructionPlan& plan, const SlabStore& store);

/// The whole of it, for a plan that is complete but for its cost.
ExpectedCost expected_cost(const ReconstructionPlan& plan, const Ingested& cloud);

/// Processor seconds of a whole run on the machine the model was made on.
double expected_cpu_seconds(const ReconstructionPlan& plan);

/// The window's look-up tables cover all the slabs a bucket of samples lies in, empty ones too: next to nothing, unless
/// a few samples are scattered over a long way.
std::uint64_t table_bytes(const ReconstructionPlan& plan, const SlabStore& store);

}  // namespace lamina
